"""Notes of an answer: what is assumed or violated, its effect on the result, and what to do, each with a code.

A note is its sentence, so that it can be printed, compared and counted as text; its code, severity and fields are for
programs. The code's longer explanation is in `KINDS` and, written from there, in `docs/notes.md`.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any, Literal, NamedTuple

CAUTIONS = {
    "posterior-unusable": (
        "The chains of the sampler have not mixed: intervals from this posterior are wrong. Sample for longer "
        "(`--doublings`), or free fewer numbers."
    ),
    "synthetic": (
        "The observations or the video are computed, not measured. What follows from them tests the method and "
        "describes no real robot."
    ),
    "walls-left-out": (
        "The robot is in a tube, and the named model has no walls: its speed is several times too high. `--model "
        "auto` answers with `tube`."
    ),
    "pose-unknown": (
        "The gap under the body or its pitch is not given, and they decide much of the speed. `--band` computes the "
        "range, `--gap` and `--pitch` state them, `--motion free` finds the pose."
    ),
    "robot-floats": (
        "Buoyancy lifts the robot off the floor, and axial motion holds it at a pose there. Its trial, `simulate` and "
        "`settle` follow it to where it goes. Check `body.mass`."
    ),
    "outside-validity": (
        "A field lies outside the range in which the model is accurate: the error is larger than the stated one. "
        "Another model may hold there."
    ),
    "inertia": (
        "All models neglect inertia (Stokes flow). Above a Reynolds number of 0.1 the error grows, and no estimate "
        "covers it; above 10 the answer is refused."
    ),
    "calibration-missing": (
        "The model has no walls, and no drag factors that could replace their effect. Calibrate, or use model `tube`."
    ),
    "calibration-outside": (
        "Drag factors, or other fitted values, are of a body and a channel of other sizes. Calibrate again, or use "
        "model `tube` without a calibration."
    ),
    "friction-unset": (
        "The effective friction B_eff of equation (18) is not given: rates and speeds are upper bounds. Set "
        "`friction.effective`, or calibrate with observed rates."
    ),
    "friction-negative": (
        "The inferred effective friction, or the lower end of its interval, is negative: the torque that the model "
        "predicts exceeds that of the motor. Check the rates' units, the motor's constants and the tail. Predictions "
        "take zero."
    ),
    "friction-counted-twice": (
        "A body drag factor below 1 already includes friction on the body; the friction model `paper` counts it "
        "again. Use `--friction rotor`."
    ),
    "friction-not-fitted": (
        "B_eff of this tail was not fitted. The median of the fitted tails is used; the intervals of a posterior "
        "include their spread."
    ),
    "friction-other-fit": (
        "B_eff was inferred with another model or friction model than the one in use. Fit again with this model."
    ),
    "friction-ignored": (
        "With a prescribed tail rate the effective friction is inferred from (17) and (18); `friction.effective` has "
        "no effect."
    ),
    "fit-not-used": (
        "Nothing in the calibration or posterior applies to this robot and model. Name the model that was fitted, or "
        "fit in this channel."
    ),
    "fit-other-motion": (
        "Numbers were fitted to robots held at a pose and are used for free motion, or to trials and are used for "
        "held motion: intervals need not contain the observations."
    ),
    "field-slips": (
        "The field turns as fast as, or faster than, the step-out rate: rates and speed are averages over slips. "
        "Lower the rate, or raise the flux density."
    ),
    "tail-against-motor": (
        "At the prescribed rate the tail turns against its motor, or drives it: friction, current and power have no "
        "meaning. Check the rate's sign, `motor.polarity` and `tail.handedness`."
    ),
    "torque-unexplained": (
        "With this friction model nothing balances the rest of the motor's torque; the friction model `rotor` infers "
        "what does."
    ),
    "no-weight": (
        "Masses are missing or left out: the robot is taken to rest on the floor (a bare tail: on the axis), or moves "
        "without weight. Give `body.mass` and `tail.density`, or the pose."
    ),
    "imposed-flow": (
        "Efficiencies and cost of transport use the velocity in the lab, and do not compare with those in fluid at "
        "rest."
    ),
    "table-not-checked": (
        "The motion reaches poses beyond those at which the robot's table was compared with full solutions, or the "
        "table misses them by more than it should: the error estimate does not cover them. In films of 50 and 100 um "
        "resistances of the paper's level robot are within 2.1 % of direct solutions, in films of micrometres within "
        "1.1 % of exact ones of long cylinders, 4 % of Reynolds' equation under short ones."
    ),
    "held-by-friction": (
        "Dry friction is larger than the thrust: the speed that is left comes from the smoothing of the friction "
        "law, and means no motion."
    ),
    "unsteady": (
        "The motion is not steady, or approaches its steady state more slowly than a trial lasts. Means depend on "
        "the start and on the duration."
    ),
    "velocity-along-x": "The robot sinks, rises, or follows a tilted field. Velocities are the components along x.",
    "run-cut-short": "The run ended before its requested end. Averages are over the part that was run.",
    "schedule-outside-run": (
        "Switching times or rows of a flow file lie outside the run and have no effect. Check the duration."
    ),
    "misfit": (
        "The model misses the observations by more than the scatter of the trials: fitted numbers compensate for it "
        "(model discrepancy) and hold for these tails alone."
    ),
    "not-identifiable": (
        "The observations hardly determine a number, or only a combination of several: its value comes from the "
        "prior. Fix one of them, or state its uncertainty."
    ),
    "prior-decides": (
        "A fitted number lies far from the median of its prior, or at an end of it. The model, a unit or the robot "
        "may be wrong."
    ),
    "outlier": (
        "A trial or a tail differs from the others by far more than they scatter. It still counts. Check the row and "
        "the video."
    ),
    "friction-assumed": (
        "The fit needs an assumption about friction that the observations do not test, and predicted rates depend on "
        "it."
    ),
    "intervals-incomplete": (
        "Intervals leave a source of error out, or rest on too few trials, draws or robots. Repeat trials, state "
        "uncertainties, or take more draws."
    ),
    "drag-order": "The drag factor of a narrower channel is below that of a wider one. Channels may be mixed up.",
    "units-doubtful": (
        "Numbers look as if they were in another unit or of another sign. Check Hz against rad/s, and that all rates "
        "are signed about the same axis."
    ),
    "robot-file-doubtful": "Fields of the robot file contradict each other, or no robot can have them. Check the file.",
    "curve-smoothed": (
        "Smoothing by `tail.curve_tolerance` changes the centre line by more than noise. Thrust goes with the square "
        "of its radius. Lower the tolerance, or leave it out."
    ),
    "design-at-limit": "The best design lies at an end of a range, or a better one lies outside. Widen the range.",
    "design-tie": (
        "The lead of the best design is smaller than the error of its objective, or a field has no effect. Choose by "
        "cost."
    ),
    "without-answer": (
        "Some robots, poses or candidates have no answer; the note gives the first and why. They are left out of "
        "rankings and bands."
    ),
    "models-differ": (
        "The compared models differ in what they include (walls, calibration, coupling), not in their theory alone."
    ),
    "coupling-left-out": "The model has no coupling between body and tail; its drag is missing.",
    "axial-only": "The model gives resistances along and about the motor axis alone; the other entries are unknown.",
    "cannot-resolve": (
        "With this camera and view a rate or length cannot be resolved. Raise the frame rate, or narrow the view."
    ),
    "pixel-size-unknown": (
        "Lengths and speeds have no unit. Give `--view-width`, `markers.length_per_pixel`, or a video that shows the "
        "ruler."
    ),
    "setup-incomplete": (
        "The setup lacks something about the experiment, such as uncertain heights or stripes. Fill in the named "
        "fields."
    ),
    "not-measured": "A video, or a quantity of it, could not be measured; the note says why.",
    "swims-backwards": (
        "With this sign of the tail rate the robot moves backwards. Forward are positive rates of a right-handed "
        "tail and negative ones of a left-handed one."
    ),
    "mesh-not-closed": "A surface file is not a single closed body. Use the named unit, or repair it before printing.",
    "physics-engine-fluid": (
        "MuJoCo's own fluid model gives a helix no thrust and must stay off. Apply the forces of the resistance "
        "matrix at every step."
    ),
    "out-of-picture": "The robot leaves the picture during the film, so that its trial is shorter than the film.",
    "aliased-film": (
        "The tail turns too far from frame to frame to be seen as it turns. Lower the speed of the film, or raise "
        "its frame rate."
    ),
    "drawn-otherwise": "Fields are drawn at another sample or pose than the requested one; the note says which.",
    "incomplete-flow-field": (
        "The flow field is that in unbounded fluid, though the robot is in a channel. Use model `tube`."
    ),
    "remark": "A remark without a code of its own.",
}
"""Notes that change what numbers mean, the weightiest first."""

INFORMATION = {
    "constant-torque": (
        "With `drive.kind = 'torque'` rates and speed fall as one over the viscosity; those of a motor fall less."
    ),
    "model-chosen": (
        "The model or the kind of motion was chosen from what is known of the robot. `--model` and `--motion` name "
        "others."
    ),
    "settled-basis": (
        "Robots are compared held at a pose, or in their steady state; speed and order may differ, and a trial lies "
        "between them."
    ),
    "reference-pose": (
        "All designs are compared at the same pose, or with the same drag factors. Predict the best ones with `tube` "
        "and its band."
    ),
    "interpolated": "Resistances are interpolated between computed robots or poses; the checked error is stated.",
    "input-unused": "Part of the input has no effect, as columns that are not read or a seed without anything random.",
    "files": (
        "Files of an earlier result were removed or left in the folder, or a file is not written. The note says which."
    ),
    "lines-not-sent": "The network refused some of the lines. Check address and port.",
}
"""Notes that explain numbers."""

_FAMILIES = {
    "aliased-tail aliased-body tail-turns-lost body-turns-lost counted-within-a-turn": (
        "The rotation is too fast for the frame rate, or whole turns are missing. Record with more frames a second, "
        "or state the expected rate."
    ),
    (
        "no-stripes stripe-order stripes-do-not-fit stripes-do-not-pass stripes-of-another-size stripes-under-glare "
        "stripes-unreadable uneven-stripes short-turn"
    ): (
        "The stripes are not read as the robot file describes them: the rotation of the body is uncertain or not "
        "given. Check number, order and widths in the annotated video."
    ),
    "tail-unreadable tail-does-not-fit handedness mirrored": (
        "The tail's phase cannot be read, or its handedness is not that of the robot file. Check `tail.handedness` "
        "and dimensions."
    ),
    "size-does-not-fit outline-does-not-fit scale-does-not-fit focal-lengths-differ ends-drift-apart outline-hops": (
        "Size or outline in the picture differ from the robot file at this scale. Lengths and speeds are less "
        "certain or not given. Check the robot file, the heights and the ruler."
    ),
    "outline-alone cues-disagree": (
        "Over a grid or through glass the outline may follow what is not the body's: no coloured seal was found, or it "
        "moves otherwise. Speed and tail rate are less certain or not given. Use a bright seal or plain paper."
    ),
    "two-robots not-the-robot something-else-followed does-not-advance one-picture": (
        "What was tracked may not be the robot, or not the only one. Nothing, or less, is given. Crop the video to "
        "one robot."
    ),
    "robot-stands-still": (
        "The robot is in view and does not move. Speed and rates are 0, or not given where too little of it is seen. "
        "Check its motor, or film for longer."
    ),
    (
        "robot-not-seen robot-came-late robot-left-the-view robot-lost robot-partly-out-of-view edges-hidden standing-"
        "glare too-few-frames"
    ): ("The robot is out of view, hidden or not detected on part of the frames; the others count."),
    "nose-on-the-other-side moves-backwards": (
        "The robot's direction in the picture does not agree with its motion or shape. Check `robot.direction`."
    ),
    "camera-moved camera-rolled camera-swayed": (
        "The camera moved or is tilted. Its motion is taken out where the background shows it; lengths and speeds "
        "are less certain. Fix the camera."
    ),
    (
        "dropped-frames lost-frames repeated-frames uneven-steps unordered-times times-do-not-fit clock-in-doubt rate-"
        "replaced video-is-cut unreadable-frames video-ends-early"
    ): (
        "Frames are missing, doubled or unevenly spaced, or times do not agree with the motion. Record with the "
        "camera's own time stamps, and do not edit the video."
    ),
    "pixels-not-square pixel-aspect-replaced pictures-turned slant-left-out sixteen-bit-images several-films": (
        "The video file states its pictures in an unusual way. Check that the annotated video looks right."
    ),
    "not-steady stray-frames stands-for-a-while reverses": (
        "A rate changes during the trial more than its errors allow, or some frames deviate. The rate is a mean over "
        "the trial."
    ),
    "copy-of-a-trial": ("The trial repeats another one frame by frame, so that the mean counts it twice."),
    "by-hand corrected-by-hand imported no-video track-not-checked track-beside-the-robot track-moves-otherwise": (
        "Readings were made or corrected by hand, or taken from another program."
    ),
}
"""Names of flags of a video and of its trial, and what they mean."""
TRACKING = {name: words for names, words in _FAMILIES.items() for name in names.split()}
"""Flags that the tracker and `measure` raise, by their names."""


LONGEST = 160
"""Largest number of characters of a sentence, without the names of robots and files in it."""


class NoteKind(NamedTuple):
    """What all notes of one code have in common."""

    severity: Literal["caution", "info"]
    """`caution`: it changes what the numbers mean; `info`: it explains them."""
    explanation: str
    """What is assumed or violated, what follows, what to do."""


_FIRST = ("posterior-unusable", "synthetic")
"""Codes that come before all flags of a video."""
_LIGHT = (
    *("stray-frames", "pixels-not-square", "pixel-aspect-replaced", "pictures-turned", "slant-left-out"),
    *("sixteen-bit-images", "several-films", "by-hand", "corrected-by-hand", "imported", "no-video"),
)
"""Codes of flags of a video that hardly change its numbers: they come last."""
KINDS: dict[str, NoteKind] = {
    **{
        code: NoteKind("caution", (CAUTIONS | TRACKING)[code])
        for code in (*_FIRST, *(name for name in TRACKING if name not in _LIGHT), *CAUTIONS, *_LIGHT)
    },
    **{code: NoteKind("info", words) for code, words in INFORMATION.items()},
}
"""Kinds of notes by code; cautions in the order in which a terminal shows them."""
_FALLBACK = "remark"
_RATES = ("-forward-velocity", "-body-rotation-rate", "-tail-rotation-rate")


class Note(str):
    """A sentence about an answer, with its code; it cannot be changed."""

    __slots__ = ("code", "fields")
    code: str
    """What the note is about, such as `walls-left-out`; a key of `KINDS`."""
    fields: tuple[str, ...]
    """Fields or quantities that it concerns, by their dotted names."""

    def __new__(cls, code: str, sentence: str, fields: Iterable[str] = ()) -> Note:
        """A note of a known code."""
        note = super().__new__(cls, sentence)
        note.code, note.fields = _known(code), tuple(fields)
        return note

    def __getnewargs__(self) -> tuple[str, str, tuple[str, ...]]:  # type: ignore[override]
        """Arguments with which another process recreates it."""
        return self.code, str(self), self.fields

    @property
    def severity(self) -> Literal["caution", "info"]:
        """Whether it changes what the numbers mean."""
        return KINDS[self.code].severity

    @property
    def sentence(self) -> str:
        """The sentence."""
        return str(self)

    @property
    def explanation(self) -> str:
        """What all notes of its code mean."""
        return KINDS[self.code].explanation

    def prefixed(self, words: str) -> Note:
        """The note with words before its sentence, such as the name of the robot that it is about."""
        return Note(self.code, f"{words}{self}", self.fields)

    def to_dict(self) -> dict[str, Any]:
        """The note as data."""
        return {"code": self.code, "severity": self.severity, "sentence": str(self), "fields": list(self.fields)}


def _known(code: str) -> str:
    """A code of `KINDS`; names of flags that end in a rate are of one kind for all rates."""
    for rate in _RATES:
        code = code.removesuffix(rate)
    if code not in KINDS:
        raise KeyError(f"notes have no code {code!r}; add it to notes.py")
    return code


def notes_of(sentences: Iterable[str]) -> tuple[Note, ...]:
    """Notes; a sentence without a code, as in files of earlier versions, becomes a remark."""
    return tuple(item if isinstance(item, Note) else Note(_FALLBACK, item) for item in sentences)


def note_attributes(notes: Iterable[str]) -> dict[str, str]:
    """Notes as attributes of a dataset: `warnings` for people, a sentence each line, and `notes` as JSON."""
    found = notes_of(notes)
    return {"warnings": "\n".join(found), "notes": json.dumps([note.to_dict() for note in found])}


def notes_in(attributes: Mapping[Any, Any]) -> tuple[Note, ...]:
    """Notes of a dataset, from its attributes; one of an earlier version has sentences alone."""
    if "notes" not in attributes:
        return notes_of(line for line in str(attributes.get("warnings", "")).split("\n") if line)
    return notes_in_answer({"notes": json.loads(attributes["notes"])})


def notes_in_answer(answer: Mapping[str, Any]) -> tuple[Note, ...]:
    """Notes of an answer that is data."""
    return tuple(Note(item["code"], item["sentence"], item["fields"]) for item in answer.get("notes", ()))


def shown_cautions(notes: Iterable[Note], most: int = 3, width: int = 80) -> list[Note]:
    """The weightiest cautions, one of a code, as many as fit into three rows of a terminal."""
    order = list(KINDS)
    first: dict[str, Note] = {}
    for note in notes:
        if note.severity == "caution":
            first.setdefault(note.code, note)
    shown: list[Note] = []
    rows = 0
    for note in sorted(first.values(), key=lambda note: order.index(note.code)):
        rows += -(-len(f"{note.severity}: {note}") // width)
        if shown and rows > most:
            break
        shown.append(note)
    return shown
