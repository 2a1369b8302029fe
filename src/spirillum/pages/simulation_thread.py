"""Simulation thread: moves the robots and publishes the newest state as text for clients."""

from __future__ import annotations

import json
import queue
import threading
import time
import tomllib
from collections.abc import Callable, Iterator, Mapping
from typing import Any, TypeVar

from spirillum.errors import InputError, failure_sentence
from spirillum.pages.job import BackgroundJob, worker
from spirillum.pages.knobs import Settings, number_of, refusal_of, report_fault, robot_tables, text_of
from spirillum.pages.page_robot import Built, PageRobot, build
from spirillum.pages.robot_data import prediction_answer, quantity_list, released_answer
from spirillum.pages.study_picture import StudyPicture
from spirillum.progress import Progress
from spirillum.robot.load import preset_names
from spirillum.robot.robot import Robot, robot_text
from spirillum.swimming.motions import ReleasedMotion
from spirillum.swimming.preparation import WALLED


class Preparing(BackgroundJob):
    """Table in preparation; completed nodes are cached when it is cancelled."""

    def __init__(self, robot: Robot, announce: Callable[[], None]) -> None:
        super().__init__(__name__, {"robot": robot_text(robot)}, announce)
        self.robot = robot


def _prepared(request: dict[str, Any], progress: Progress) -> dict[str, Any]:
    from spirillum.swimming.preparation import prepare

    prepare(tomllib.loads(request["robot"]), progress=progress)
    return {}


if __name__ == "__main__":
    worker(_prepared)


RATE = 30.0  #: Frames a second.
_LATE = 1.0  # time by which the run may fall behind before it no longer tries to catch up, s
SLOWEST_PACE, FASTEST_PACE = 1.0 / 64.0, 64.0
_MOST_WAITING = 2_000
_UNTOUCHED = 2.0  # time for which a robot is left as it is before its table is made, s
_PAUSE = 0.2  # rest of the thread of the simulation after a fault, s

_COLUMNS_AFTER = 1.0  # time for which a robot is left as it is before its trial and steady motion are computed, s

_Work = TypeVar("_Work")

Command = tuple[Mapping[str, Any], Callable[[str], None]]  #: Command of a client, and the callback for its refusal.


class _OutdatedError(Exception):
    """Something else was set meanwhile."""


class SimulationThread:
    """Robots, clock and commands; made in one thread, run in its own."""

    def __init__(self, source: Any, publish: Callable[[], None]) -> None:
        self._own = source if isinstance(source, str) and source in preset_names() else robot_tables(source)
        self._publish = publish
        self._inbox: queue.Queue[Command | None] = queue.Queue(_MOST_WAITING)
        self._wanted: dict[int, tuple[int, int, str, Settings, Robot, Robot]] = {}
        self._work = threading.Condition()
        self._released: dict[int, tuple[int, int, dict[str, Any], Settings, Robot]] = {}
        self._built: queue.Queue[tuple[int, int, int, Built | None, dict[str, Any] | None, str]] = queue.Queue()
        self._swimmers = [PageRobot.of(self._own)]
        self._preparing: Preparing | None = None
        self._left_off: Robot | None = None
        self.study: StudyPicture | None = None  #: What tails can be pointed at in.
        self._playing, self._pace, self._looked_at = True, 1.0, False
        self._ending = threading.Event()
        self._requested: list[int] = []
        self._behind = 0.0
        self._lock = threading.Lock()
        self.version, self.scene, self.frame = 0, "", ""
        self._actions: dict[str, Callable[[PageRobot, Mapping[str, Any]], None]] = {
            "set": self._set,
            "preset": lambda swimmer, command: swimmer.preset(text_of(command, "value"), self._own),
            "tail": self._tail,
            "undo": lambda swimmer, _: swimmer.undo(),
            "redo": lambda swimmer, _: swimmer.undo(forward=True),
            "restart": self._restart,
            "remote": self._remote,
            "duty": lambda swimmer, command: swimmer.set_duty(number_of(command, 0.0, 1.0)),
            "play": self._play,
            "step": self._step,
            "pace": self._set_pace,
            "compare": self._compare,
            "flow": self._flow,
            "prepare": self._prepare,
            "leave-off": self._leave_off,
            "wake": lambda *_: None,  # only to be listened to
        }
        self._threads = [
            threading.Thread(target=self._run, name="page: motion", daemon=True),
            threading.Thread(target=self._build, name="page: numbers", daemon=True),
            threading.Thread(target=self._release, name="page: trial and steady", daemon=True),
        ]

    def start(self) -> None:
        """Start both threads."""
        self._send_scene()
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """End both threads, and a table that is being made (what is solved of it is kept)."""
        self._ending.set()
        self._inbox.put(None)
        with self._work:
            self._work.notify_all()
        if self._preparing is not None:
            self._preparing.stop()
        for swimmer in self._swimmers:
            swimmer.without_flow()
        for thread in self._threads:
            thread.join(timeout=2.0)

    def ask(self, command: Mapping[str, Any], refuse: Callable[[str], None]) -> None:
        """Queue a change; it is made in the thread of the simulation."""
        try:
            self._inbox.put_nowait((command, refuse))
        except queue.Full:
            refuse(refusal_of(command, "the page is busy; allowed: fewer changes at once"))

    def look(self, watched: bool) -> None:  # noqa: FBT001 - one thing to say
        """Set whether there are clients; without one the simulation pauses."""
        if watched != self._looked_at:
            self._looked_at = watched
            self.ask({"do": "wake"}, lambda _text: None)

    def past(self) -> str:
        """Past samples of the robots, for a new client."""
        with self._lock:
            swimmers = [{"generation": swimmer.generation, **swimmer.recording.past()} for swimmer in self._swimmers]
        return json.dumps({"t": "past", "lanes": swimmers})

    def swimmer_number(self, requested: Any) -> int:
        """The number of a robot that is there."""
        if isinstance(requested, bool) or not isinstance(requested, int) or not 0 <= requested < len(self._swimmers):
            raise InputError(f"lane = {str(requested)[:20]}; allowed: 0 to {len(self._swimmers) - 1}")
        return requested

    def recording(self, index: int) -> tuple[PageRobot, dict[str, Any]] | None:
        """A robot and its run so far; None if there is no such robot or no run."""
        with self._lock:
            if not 0 <= index < len(self._swimmers):
                return None
            swimmer = self._swimmers[index]
            return swimmer, swimmer.recording.data()

    def flow(self, index: int) -> dict[str, Any] | None:
        """The plane of the flow around a robot; None if there is none."""
        with self._lock:
            flowing = self._swimmers[index].flowing if 0 <= index < len(self._swimmers) else None
        return None if flowing is None else flowing.progress().get("plane")

    # the thread of the simulation

    def _run(self) -> None:
        for index in range(len(self._swimmers)):
            self._want(index)
        last = time.perf_counter()
        while not self._ending.is_set():
            try:
                last = self._run_once(last)
            except Exception as error:  # the thread lives on, whatever a robot meets
                report_fault(error)
                self._ending.wait(_PAUSE)

    def _run_once(self, last: float) -> float:
        """Process commands, move and publish once; return the time of the last motion."""
        moving = self._playing and self._looked_at and any(self._moves(swimmer) for swimmer in self._swimmers)
        changed = self._listen(1.0 / RATE - (time.perf_counter() - last) if moving else 0.2)
        now = time.perf_counter()
        if moving and now - last >= 0.9 / RATE:
            self._advance(now - last)
            last = now
            changed = True
        elif not moving:
            last = now
        if changed:
            self._publish_frame()
        return last

    def _moves(self, swimmer: PageRobot) -> bool:
        return swimmer.built is not None and not swimmer.failure and not (swimmer.moment and swimmer.moment.ended)

    def _advance(self, elapsed: float) -> None:
        """All robots by the same time, so that they stay together."""
        self._behind = max(0.0, elapsed - 1.0 / RATE)
        dt = min(elapsed, _LATE) * self._pace
        if not self._all_ready():
            return
        with self._lock:
            for swimmer in self._swimmers:
                swimmer.advance(dt)

    def _all_ready(self) -> bool:
        """Those who are ready wait for those who are not."""
        return all(swimmer.built is not None or swimmer.failure for swimmer in self._swimmers)

    def _listen(self, wait: float) -> bool:
        """Process pending commands; block if there is nothing to do."""
        changed = self._receive()
        try:
            item = self._inbox.get(timeout=max(wait, 0.0)) if wait > 0 else self._inbox.get_nowait()
        except queue.Empty:
            return changed
        while item is not None:
            command, refuse = item
            try:
                with self._lock:
                    self._do(command)
            except Exception as error:  # the thread lives on, whatever a command meets
                report_fault(error)
                refuse(refusal_of(command, failure_sentence(error)))
            changed = True
            try:
                item = self._inbox.get_nowait()
            except queue.Empty:
                break
        for index, swimmer in enumerate(self._swimmers):
            if self._requested[index : index + 1] != [swimmer.revision]:
                self._want(index)
        self._send_scene()
        return changed

    def _do(self, command: Mapping[str, Any]) -> None:
        what = str(command.get("do"))
        swimmer = self._swimmers[self.swimmer_number(command.get("lane", 0))]
        if what not in self._actions:
            raise InputError(f"do = {what[:40]!r}; allowed: {', '.join(self._actions)}")
        self._actions[what](swimmer, command)

    def _set(self, swimmer: PageRobot, command: Mapping[str, Any]) -> None:
        name, value = text_of(command, "field"), text_of(command, "value")
        if name != "run.flow" or not swimmer.flow(value):
            swimmer.set(name, value)

    def _tail(self, swimmer: PageRobot, command: Mapping[str, Any]) -> None:
        if self.study is None:
            raise InputError("tail: no study is shown; allowed: a study first")
        swimmer.swap(*self.study.tail(command))

    def _restart(self, _lane: PageRobot, _command: Mapping[str, Any]) -> None:
        for swimmer in self._swimmers:
            swimmer.start_anew()

    def _remote(self, swimmer: PageRobot, command: Mapping[str, Any]) -> None:
        swimmer.remote = bool(command.get("value"))

    def _flow(self, swimmer: PageRobot, command: Mapping[str, Any]) -> None:
        if command.get("value"):
            swimmer.with_flow(self._wake_up)
        else:
            swimmer.without_flow()

    def _play(self, _lane: PageRobot, command: Mapping[str, Any]) -> None:
        self._playing = bool(command.get("value"))

    def _step(self, _lane: PageRobot, _command: Mapping[str, Any]) -> None:
        self._playing = False
        if self._all_ready():
            for swimmer in self._swimmers:
                swimmer.advance(self._pace / RATE)

    def _set_pace(self, _lane: PageRobot, command: Mapping[str, Any]) -> None:
        self._pace = number_of(command, SLOWEST_PACE, FASTEST_PACE)

    def _compare(self, _lane: PageRobot, command: Mapping[str, Any]) -> None:
        if not command.get("value"):
            for swimmer in self._swimmers[1:]:
                swimmer.without_flow()
            del self._swimmers[1:]
        elif len(self._swimmers) == 1:
            first = self._swimmers[0]
            second = PageRobot(first.settings, first.robot, first.remote, first.duty)
            first.start_anew()
            self._swimmers.append(second)

    def _prepare(self, swimmer: PageRobot, _command: Mapping[str, Any]) -> None:
        if self._preparing is not None and self._preparing.running:
            raise InputError("another table is being computed; allowed: one at a time")
        self._preparing, self._left_off = Preparing(swimmer.robot, self._wake_up), None

    def _leave_off(self, _lane: PageRobot, _command: Mapping[str, Any]) -> None:
        if self._preparing is not None:
            self._preparing.stop()

    def _wake_up(self) -> None:
        self.ask({"do": "wake"}, lambda _text: None)

    # the thread of the numbers

    def _want(self, index: int) -> None:
        swimmer = self._swimmers[index]
        self._requested[index:] = [swimmer.revision]
        with self._work:
            known = "" if swimmer.built is None else swimmer.built.model
            robots = swimmer.robot, swimmer.predicted()
            self._wanted[index] = (swimmer.generation, swimmer.revision, known, swimmer.settings, *robots)
            self._work.notify_all()

    def _each_of(self, waiting: dict[int, _Work]) -> Iterator[tuple[int, _Work]]:
        """Robots with the work that waits for a thread, as it comes, until the page ends."""
        while True:
            with self._work:
                self._work.wait_for(lambda: waiting or self._ending.is_set())
                if self._ending.is_set():
                    return
                index = next(iter(waiting))
                work = waiting.pop(index)
            yield index, work

    def _build(self) -> None:
        """Release robots, and compute their held numbers."""
        for index, (generation, revision, known, settings, robot, predicted) in self._each_of(self._wanted):
            try:
                model = known
                if not model:
                    built = build(settings, robot)
                    model = built.model
                    self._built.put((index, generation, revision, built, None, ""))
                    self._wake_up()
                from spirillum.swimming.prediction import predict_steady

                placement = settings.placement() if model == "tube" else None
                numbers = prediction_answer(predict_steady(predicted, model=model, placement=placement))
                self._built.put((index, generation, revision, None, numbers, ""))
                if numbers["columns"]:
                    with self._work:
                        self._released[index] = (generation, revision, numbers, settings, predicted)
                        self._work.notify_all()
            except Exception as error:  # the thread lives on, whatever a robot's numbers meet
                report_fault(error)
                self._built.put((index, generation, revision, None, None, failure_sentence(error)))
            self._wake_up()

    def _release(self) -> None:
        """Compute trial and steady motion beside held numbers, one column after the other."""
        for index, (generation, revision, held, settings, robot) in self._each_of(self._released):
            try:
                numbers = held
                for name, motion in self._columns(index, revision, settings, robot):
                    numbers = {**numbers, "columns": {**numbers["columns"], name: released_answer(motion)}}
                    self._built.put((index, generation, revision, None, numbers, ""))
                    self._wake_up()
            except _OutdatedError:
                pass
            except Exception as error:  # the thread lives on, and the columns stay empty
                report_fault(error)

    def _columns(
        self, index: int, revision: int, settings: Settings, robot: Robot
    ) -> Iterator[tuple[str, ReleasedMotion]]:
        """The released motions of a robot, as long as nothing else is set."""
        from spirillum.dynamics.prediction import predict

        def check(_what: str, _done: int, _total: int) -> None:
            if self._ending.is_set() or self._requested[index : index + 1] != [revision]:
                raise _OutdatedError

        self._ending.wait(_COLUMNS_AFTER)
        check("", 0, 0)
        held = predict(robot, model=WALLED, placement=settings.placement(), band=False, progress=check)
        for name, compute in held.released.items():
            motion = compute()
            check("", 0, 0)
            yield name, motion

    def _receive(self) -> bool:
        """Take what was built, unless something else was set meanwhile."""
        changed = False
        while True:
            try:
                index, generation, revision, built, numbers, failure = self._built.get_nowait()
            except queue.Empty:
                break
            if index >= len(self._swimmers) or self._swimmers[index].generation != generation:
                continue
            swimmer = self._swimmers[index]
            with self._lock:
                if built is not None:
                    swimmer.take(built)
                if numbers is not None and revision == swimmer.revision:
                    swimmer.numbers = numbers
                if failure and revision == swimmer.revision:
                    swimmer.failure, swimmer.numbers = failure, None
            changed = True
        if self._preparing is not None:
            changed = self._look_at_table(self._preparing) or changed
        elif self._looked_at:
            self._make_table()
        if changed:
            self._send_scene()
        return changed

    def _make_table(self) -> None:
        """Start the table of a robot that swims provisionally and is left as it is, unless it was left off."""
        now = time.monotonic()
        for swimmer in self._swimmers:
            untouched = swimmer.built is not None and swimmer.built.provisional and now - swimmer.since > _UNTOUCHED
            if untouched and swimmer.robot != self._left_off:
                self._preparing = Preparing(swimmer.robot, self._wake_up)
                return

    def _look_at_table(self, preparing: Preparing) -> bool:
        """Publish the progress of a table to the robots that it is for; whether it has changed."""
        said, running = preparing.progress(), preparing.running
        before = [swimmer.preparing for swimmer in self._swimmers]
        for index, swimmer in enumerate(self._swimmers):
            own = swimmer.robot == preparing.robot
            swimmer.preparing = said if own else None
            if own and said.get("done") and not running:
                swimmer.start_anew()
                self._want(index)
        if not running:
            self._preparing = None
            self._left_off = None if said.get("done") else preparing.robot
        elif all(swimmer.robot != preparing.robot for swimmer in self._swimmers):
            preparing.stop()
        return before != [swimmer.preparing for swimmer in self._swimmers]

    # messages to the clients

    def _send_scene(self) -> None:
        scene = {
            "t": "scene",
            "lanes": [swimmer.scene() for swimmer in self._swimmers],
            "quantities": quantity_list(),
            "presets": list(preset_names()),
            "own": self._own if isinstance(self._own, str) else "own",
            "playing": self._playing,
            "pace": self._pace,
        }
        text = json.dumps(scene)
        if text != self.scene:
            self.scene = text
            self.version += 1
        self._publish_frame()

    def _publish_frame(self) -> None:
        swimmers = [swimmer.frame() for swimmer in self._swimmers]
        self.frame = json.dumps({"t": "frame", "lanes": swimmers, "playing": self._playing, "behind": self._behind})
        self._publish()
