"""A bench without hardware: the virtual camera before a plant, the live tracker behind it, and a remote at a port.

The closed loop of `spirillum.control` takes it in place of the modelled camera and remote: pictures are drawn and
tracked, and commands go through the line protocol. Frames are lost, late and cut off as the lab says.
"""

from __future__ import annotations

from contextlib import ExitStack

from spirillum.controllers.lab import Lab
from spirillum.controllers.sensors import Command, Detection, Senses
from spirillum.dynamics.plant import Plant, Snapshot
from spirillum.errors import InputError
from spirillum.files import scratch_folder
from spirillum.interfaces.serial_remote import SerialRemote, VirtualRemote
from spirillum.live.tracker import LiveTracker
from spirillum.virtual.live_camera import VirtualCamera

VIRTUAL = "virtual"  #: Port of a remote that is made for the run, on a pseudo-terminal.
_TRIES = 3
"""How often a virtual remote is polled before it counts as gone: a busy machine may delay it, but not the robot, whose
time stands still.
"""
_LEARN = 3.0  # time from which the tracker learns the robot's look, s


class Bench(Senses):
    """Camera, meter and remote of one run, with pictures and a port in place of the modelled ones."""

    def __init__(
        self,
        plant: Plant,
        lab: Lab,
        seed: int,
        *,
        tracked: bool = True,
        degradation: str | None = None,
        port: str | None = None,
    ) -> None:
        """Set up.

        Args:
            plant: the robot where its run begins; it is not moved.
            lab: frame rate, latency, lost frames, the remote's delay and losses, and the meter.
            seed: of all that is drawn.
            tracked: let the live tracker look at pictures of the virtual camera; else the modelled camera sees.
            degradation: of the pictures, `clean` or `degraded`; None: clean.
            port: serial port of a remote to which the commands go, or `virtual`; None: none.

        Raises:
            InputError: for a robot that the camera cannot show, or a port without a remote.
        """
        super().__init__(lab, seed)
        self._left = ExitStack()
        self._reason = "the tracker has not yet learnt how the robot looks"
        self._eye: VirtualCamera | None = None
        self._tracker: LiveTracker | None = None
        self._port: SerialRemote | None = None
        self.virtual: VirtualRemote | None = None  #: The remote of the port `virtual`.
        try:
            if tracked:
                pose = plant.observe().pose
                options = {"fps": lab.camera.fps}
                self._eye = VirtualCamera(plant.robot, pose, camera=options, degradation=degradation, seed=seed)
                self._shift = self._eye.x_of(pose) - float(pose.position[0])
                folder = self._left.enter_context(scratch_folder())
                self._tracker = LiveTracker(
                    self._eye.setup(folder / "bench.toml"), learn=_LEARN, name="the virtual camera"
                )
            if port is not None:
                if port == VIRTUAL:
                    self.virtual = self._left.enter_context(VirtualRemote())
                self._port = self._left.enter_context(SerialRemote(port if self.virtual is None else self.virtual.port))
        except BaseException:
            self._left.close()
            raise

    def not_ready(self, time: float) -> str:  # noqa: ARG002 - it has learnt or not
        """Why nothing can be seen yet at a time, s; empty once the tracker knows the robot."""
        return self._reason if self._tracker is not None and not self._tracker.learnt else ""

    def sight(self, moment: Snapshot) -> Detection | None:
        """Observation of the next picture by the tracker; None while it learns, and where frame or robot are lost."""
        modelled = super().sight(moment)
        if self._eye is None or self._tracker is None:
            return modelled
        shot = self._eye.take(moment.time, moment.pose)
        if modelled is None:
            self._tracker.left_out(1)
            return None
        seen = self._tracker.update(shot.image, shot.time)
        self._reason = seen.reason or self._reason
        if not seen.seen:
            return None
        return Detection(
            shot.time, seen.x - self._shift, seen.heading, seen.body_angle, seen.tail_phase - seen.body_angle
        )

    def deliver(self, command: Command) -> Command:
        """The command as the motor's end has taken it.

        Raises:
            InputError: for a port that is gone, or a remote that does not answer.
        """
        if self._port is None:
            return command
        tries = 1 if self.virtual is None else _TRIES
        while True:
            tries -= 1
            try:
                return Command(self._port.send(command.duty), command.field)
            except InputError:
                if not tries:
                    raise

    def close(self) -> None:
        """Switch the remote off and put everything away."""
        self._left.close()
