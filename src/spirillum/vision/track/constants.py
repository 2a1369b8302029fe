"""Tuned numbers of the tracker that more than one module uses: one frozen set for each stage; others stand beside it.

Where a field names no source, its value was set by hand while the tracker was developed on rendered videos; nothing
else stands behind it. What halving and doubling them does to measured rates is in `docs/measuring-accuracy.md`, found
by `benchmarks/tracker_constants.py`. Numbers that are definitions or numerical resolutions stand where they are used;
compiled loops (`spirillum.kernels`) keep theirs as compile-time constants, because arguments would slow them down.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import radians


@dataclass(frozen=True)
class OutlineConstants:
    """Sub-pixel fit of the body's edges (`body`)."""

    half_profile: int = 6  #: Reach of the brightness profiles on either side of an edge, pixels.
    blur: float = 0.8  #: Standard deviation of the blur that makes a picture smooth between its pixels, pixels.
    noise_correlation: float = 2.8  #: Length along an edge over which the blurred noise is correlated, pixels.
    largest_shift: float = 2.5  #: Largest displacement of an edge within the linear range, pixels.
    rounding_noise: float = 1.5  #: Least standard deviation of brightness in a compressed video, of 255.
    iterations: int = 5  #: Most Gauss-Newton steps on a frame.
    learning_rounds: int = 5
    """Rounds of learning, in which mean profiles of the edges and places of the frames are renewed in turn."""
    smoothed_rounds: int = 2  #: Rounds after which outlying poses are still replaced by a smooth path.
    neighbours: int = 2  #: Edge points on each side whose frames are pooled with those of a point to learn its profile.
    least_strength: float = 0.2  #: Contrast of an edge on a frame over its usual one below which it is left out.
    least_share: float = 0.3  #: Share of the edges that have to fit.
    trusted_error: float = 0.6
    """Standard deviation of an edge's position above which it is not used for the body's size, pixels."""
    strength_cap: float = 10.0  #: Contrast from which on all edges weigh the same in the body's size, of 255.
    largest_error: float = 0.7  #: Largest standard error of a place that is kept, pixels.
    fewest_at_end: int = 5  #: Fewest edges at the nose, and at rear and seal, for the distance of both.


@dataclass(frozen=True)
class SealConstants:
    """Detection of the seal by its colours, and its edges (`seal`, `seal_search`, `anchored`)."""

    search_width: float = 24.0  #: Diameter of the body in the grid in which a seal is looked for, points.
    search_blur: float = 0.8  #: Least standard deviation of the blur of the picture in which it is looked for, pixels.
    least_score: float = 12.0
    """Least difference of colour between a seal and its surroundings, of 255; of videos without one it was below 6."""
    clear_share: float = 0.7  #: Least share of the frames on which it is found and its edges fit.
    clear_distance: float = 3.0  #: Distance from an edge from which on colours are those of one side, pixels.
    edge_blur: float = 1.2  #: Standard deviation of the blur of an edge to begin with, pixels.
    floors: tuple[float, float] = (0.1, 0.3)  #: Least standard error of an edge at ends and silhouettes, pixels.
    noise: float = 6.0  #: Standard deviation of the noise of a colour, of 255.
    ground: float = 12.0
    """Distance from a silhouette up to which the colours of the ground are learnt, pixels: a period of a grid."""
    along_line: float = 4.0
    """Variance of colours beside a silhouette over that of the ground: a line that covers a fifth may lie along it."""
    distinct: float = 2.0  #: Least distance of a stripe's colour from its surroundings, standard deviations.
    strengths: tuple[float, float] = (0.4, 2.0)  #: Least and largest contrast of an edge over that of its colours.
    edges: int = 60  #: About how many of the seal's edges are used: neighbours have much of their noise in common.
    pooled: int = 2  #: Edges on either side whose surroundings are averaged.
    fewest_of_kind: int = 8  #: Fewest edges from which surroundings, and the bias of a colour, are learnt.
    learning_rounds: int = 3  #: Rounds in which colours, biases and places of the frames are learnt in turn.
    joint_rounds: int = 3  #: Rounds in which the edges that move with the seal are learnt with it.
    follows_seal: tuple[float, float] = (0.5, 0.9)
    """Scatter of an edge about the motion of the seal alone, along and across the body, beyond which it does not move
    with the body, pixels: the seal determines the lateral position less well."""
    follows: tuple[float, float] = (0.4, 0.4)
    """Scatter about the motion of all edges that move with the body, along and across, beyond which an edge does not,
    pixels."""
    least_scale: float = 1.0
    """Residual scale over the expected one below which no further edges are outliers: sides that fit better than their
    errors would else reject ends of the seal that scatter by theirs."""
    fewest_of_side: int = 5  #: Fewest edges at each of two sides whose distance gives the seal's size.
    proportions: float = 0.15
    """Relative difference of its length and its width from which on a block of colour is no whole seal."""
    size_tolerance: float = 0.02
    """Relative difference of its size up to which it is as expected: compression shifts edges of colours."""
    one_way: float = 1.3
    """Difference of its length or its width alone beyond which it is not as expected, whatever the other, pixels."""
    size_error: float = 0.005  #: Change of another size that was found up to which it is not sought any longer.
    largest_difference: float = 0.1
    """Relative difference from the stated size beyond which it is no seal of this robot at this scale."""
    sizes: int = 4  #: Most sizes at which it is fitted, each the one that the one before has found.
    swings: float = 0.8
    """Scatter of the seal's steps across an edge from which on one that stays is no edge of the body, pixels."""
    outline_share: float = 0.6
    """Share of the outline's edges that have to move with the seal before the body is followed by its outline."""
    nose_share: float = 0.8
    """Share of the edges of the nose, which give the robot's displacement, that have to move with the seal, too."""
    apart: float = 0.3
    """Standard deviation between places by the outline alone and by the seal from which on they disagree, pixels."""
    off_path: tuple[float, float, float] = (2e-3, 5e-4, 0.1)
    """Distances from the robot's path, along and across, m, and heading, rad, from which on a pose took something else,
    such as a stripe, for the seal's side."""
    moves: int = 1  #: Times that its edges are learnt again where the outline lies.
    far_enough: float = 4.0
    """Displacement of the robot from which on what moves is distinguished from what stands still, pixels."""
    agreement: float = 0.015  #: Relative difference of the sizes by outline and by seal up to which they agree.
    rough_steps: int = 3  #: Steps towards a seal from several pixels away.


@dataclass(frozen=True)
class InitialDetectionConstants:
    """Whether the robot is in the video, and where (`detect_robot`)."""

    searched: int = 8  #: Frames that are searched without any prior knowledge.
    clearness: float = 1.6  #: Least score of the best place over the third best one on a frame that counts as clear.
    clear_share: float = 0.25  #: Least share of such frames.
    bend: float = 0.2
    """Second difference of the places on the frames searched over the body's length, below which, in the median, what
    stands out the other way round is one thing that goes along."""
    faint: float = 0.4
    """Score over that on the best frames below which a frame is not learnt from: the robot is partly out of view."""
    doubtful: float = 0.6  #: Score over the best frames' below which a frame is looked at again where others suggest.
    clearer: float = 1.2  #: Score there over the first one from which on it is taken.
    whole_frames: int = 4  #: Frames in full view that are enough to learn stripes and tail from.
    relearning: int = 3  #: Most times that a body is learnt again at the size and place at which its outline lies.


@dataclass(frozen=True)
class SizeConstants:
    """Apparent size of the body, a second scale beside the ruler (`size`)."""

    looked_at: int = 3  #: Frames on which sizes from half to twice the stated one are tried.
    clearness: float = 3.0
    """Least score of the best place over the third best one, median over frames, of something that is a robot."""
    stated_preference: float = 1.25
    """Factor by which an outline has to fit better that is a little larger or smaller than stated."""
    stated_range: float = 0.007  #: Relative difference of size that counts as stated in the first round of the search.
    build_error: float = 0.005  #: Standard error of the apparent size by how well a robot is built, relative. Assumed.
    edge_error: float = 0.2
    """Standard error of where its edges appear, pixels.

    Assumed; on a hundred rendered and degraded videos (70 pixels from the middle to the nose) the apparent size was
    within 0.2 % in standard deviation."""
    doubt: float = 2.0  #: Standard errors from which on size and scale differ.
    largest_difference: float = 0.1  #: Relative difference beyond which no length is given.
    unconfirmed: float = 0.05
    """Relative difference beyond which no length is given where the tail leaves the scale open: another edge than
    the body's may be followed."""
    tail_agrees: float = 0.35
    """Difference of the tail's apparent size from the ruler's or the body's up to which it agrees with it, over the
    difference of these two."""
    roll_error: float = 1.7
    """Error of the body's angle over the relative error of its outline, rad: the tangent of 60 degrees, where the
    outermost stripes are read."""
    edge_width: float = 0.6  #: Standard deviation of the Gaussian within which edges agree, pixels.
    tolerance: tuple[float, float, float, float] = (0.0125, 0.5, 0.5, 0.006)
    """Differences of size (relative), place (pixels, pixels) and heading (rad) up to which a body is taken as found."""
    found: float = 0.003
    """Such a difference of a size that is not the stated one: a body 1 % too small makes its stripes seem uneven."""


@dataclass(frozen=True)
class IdentityConstants:
    """Whether what was found is the robot (`identity`)."""

    least_share: float = 0.5  #: Least share of the sample frames on which stripes or tail are readable.
    size_tolerance: float = 0.03
    """Relative difference from the stated size beyond which both have to be read: chance makes stripes of many
    things."""
    sure_share: float = 0.75
    """Share on which the tail has to be read then, and on which it shows where the nose is.

    It was 0.83 and more on rendered videos of a hundred robots, 0.52 on one at half the size."""
    next_size: float = 0.087
    """Logarithm of the fitted size over the one looked for, beyond which the robot is looked for again at the former:
    the distance between two candidate sizes."""


@dataclass(frozen=True)
class SetupFreeConstants:
    """The first look at a video without a setup (`scouting`)."""

    distance: float = 1.15  #: Distance of the provisional lens over the width of what it shows.
    spacing: float = 2e-3  #: Spacing of a ruler's lines to begin with, m: the paper's.
    seal_sizes: tuple[float, ...] = (1.0, 1.05, 0.95)
    """Sizes over the guessed one at which a seal is fitted: by more than some hundredths its edges are out of reach."""
    nearer: float = 0.93  #: Length per pixel at the robot over that at a ruler behind it, to begin with.
    shares: tuple[float, ...] = (0.5, 0.125)
    """Shares of the picture's longer side that the robot is tried to fill; each covers half to twice of it."""
    rounds: int = 3  #: Most looks from one guess, each at the size that the one before has found.
    most_colours: int = 5  #: Most colours of stripes whose orders are tried.
    alone: int = 5
    """Fewest frames on which a robot has to be found where neither ruler nor stripes speak for it: a single picture of
    noise may show one."""
    correlation: float = 0.3
    """Least correlation of the brightness of neighbouring pixels in the static background: below it is noise alone."""
    along: int = 160  #: Places along the channel at which its walls are looked for.
    widest: float = 2.2  #: Farthest wall from the robot, over the body's diameter.
    nearest_wall: float = 0.55  #: Nearest wall, over the body's diameter.
    seen: float = 0.5  #: Share of a line along the channel that has to be in the picture.
    paper: float = 0.15  #: Width of a ruler's paper beside its lines, over the body's diameter.
    faintest: float = 0.3  #: Least usual step of the brightness from row to row, of 255.
    clear: float = 4.0  #: Step at a wall over the usual one.
    off_axis: float = 0.35  #: Twice the largest distance from the middle between two walls, over the body's diameter.
    changing_width: int = 640  #: Largest width of the reduced pictures in which motion is looked for, pixels.
    changing: float = 6.0  #: Difference from the static background over its noise from which on a pixel changes.
    changing_least: float = 6.0  #: Least such difference, of 255.
    changing_share: float = 1e-4  #: Least share of the pixels of all frames that change where something moves.


@dataclass(frozen=True)
class StandingConstants:
    """A robot that stands still, or hardly moves (`standing`)."""

    stride: int = 4  #: Every how many frames one is looked at before all of them are.
    ahead: float = 0.5
    """Width of the surroundings before its nose and behind its tail that are searched, over the body's length."""
    half_width: float = 1.0  #: Half width of these surroundings, over the body's diameter.
    moved: float = 0.1  #: Largest displacement along the channel of a robot that stands, pixels.
    turned: float = radians(1.0)  #: Largest rotation of its body and of its tail, rad.
    blur: float = 2.0  #: Standard deviation of the blur under which pictures are compared with their background, pixels
    at_rest: float = 0.999  #: Share of the pixels that change by noise alone where nothing moves.
    noise: float = 5.0  #: Largest change by noise, of 255; it was 1.5 in empty tubes, and 30 and more with a slow robot


@dataclass(frozen=True)
class StripeConstants:
    """Angle of the body from its stripes (`stripes`)."""

    reach: float = radians(78.0)  #: Largest angle from the direction to the camera at which the surface is sampled, rad
    step: float = radians(1.5)  #: Spacing of the samples, rad.
    margin: float = 0.12  #: Share of the seal's length that is left out at either end.
    lamp_tint: float = 3.0  #: Weight of the prior that the lamp's three channels change together within a frame.
    blurs: tuple[float, ...] = (0.4, 0.6, 0.8, 1.0, 1.3, 1.6, 2.0, 2.5, 3.0)
    """Standard deviations of the picture's blur that are tried, pixels."""
    cut: float = 7.99
    """Residual over the typical one at which a sample no longer counts.

    Tukey's 4.7 standard deviations of one channel, times 1.7, about the root of 3, for the norm of three."""
    edge_cut: float = 0.35
    """Least residual at which a sample no longer counts, over the step between two stripes: edges a part of a pixel
    away still pull."""
    first_residual: float = 18.0  #: Typical residual before anything was learnt, of 255.
    repeats: int = 6  #: Rounds of learning colours, shading and blur.
    repeats_without_glare: int = 2  #: First rounds, in which glare is masked.
    sheen_prior: float = 0.05  #: Weight of the prior that nothing shines.
    tint_prior: float = 2.0  #: Weight of the prior that what shines is white.
    roughness_prior: float = 0.2  #: Weight of the prior that what shines changes evenly along the angle.
    floor: float = radians(0.05)  #: Standard error of the geometry of seal and stripes, rad.
    pixel_locking: float = 0.05  #: Standard error of an edge by where it lies within a pixel, pixels.
    unreadable: float = 0.6  #: Loss over that of one even colour above which nothing is read.
    good: float = 0.3  #: Loss over that of a uniform colour below which the named colours are not tried as initial ones
    faces: float = radians(60.0)  #: Largest angle from the direction to the camera at which an edge is surely read, rad
    fits: float = 0.25
    """Loss over that of one even colour from which on the stripes are not those that are stated.

    Wrong ones had 0.26 and more, right ones on a hundred degraded videos at most 0.19."""
    width_range: float = 0.3
    """Logarithm of the stripes' width over the stated one from which on there are more or fewer of them."""
    doubt: float = 1.0  #: How much less an angle counts at which frames differ from the model by more than usual.
    white: float = 228.0  #: Brightness of the darkest channel from which on no colour is left, of 255.
    wide_glare: int = 10  #: Samples along the angle from which on glare is wide.
    halo: int = 8  #: Samples beside wide glare that it makes paler than a lamp does.
    hidden: float = 0.25
    """Share of what is seen of the seal that glare hides on half of the frames, from which on it is flagged."""
    turned_under_glare: float = 2.0
    """Stripes by which the body has to turn then, so that its rate is given: of three degraded videos on which it
    turned by less than one and a half, two were off by 24 degrees; standing glare seemed to stop another body."""
    under_glare: float = radians(12.0)
    """Standard error of the body's angle from end to end then, rad.

    On seven degraded videos, of three styles, of 3 s, in which half of the seal was hidden, the angle was off by 13
    degrees from end to end, root mean square, where the intervals expected 6."""
    ambiguous: float = 1.15  #: Least ratio of the second smallest loss to the smallest one.


@dataclass(frozen=True)
class SingleLineConstants:
    """A single painted line (`single_line`)."""

    bare: float = radians(200.0)
    """Width of a stretch of one colour from which on it fills the view while the rest faces away, rad."""
    contrast: float = 30.0  #: Least change of a colour as the line comes or goes, of 255.
    clear: float = 6.0  #: Least change of a colour over the scatter of what does not change.
    samples: int = 2  #: Fewest angles on a frame that the line covers.
    frames: int = 4  #: Fewest frames on which it does, on which it is read, and on which an angle is seen.
    kept: float = 0.5  #: Least difference of the learnt colours of line and seal over that of what was seen to move.


@dataclass(frozen=True)
class TailConstants:
    """Phase of the tail from the picture of its wire (`tail`)."""

    phases: int = 40  #: Phases that are tried on every frame.
    row_stride: int = 3  #: Every how many rows of the strip one is used there.
    row_spacing: float = 1.2  #: Distance of the rows along the tail, pixels.
    column_spacing: float = 0.25  #: Distance of columns across the tail over the wire's diameter, 0.4 to 1 pixel.
    border: float = 3.0  #: Width of the strip beyond the amplitude, over the wire's apparent diameter.
    least_share: float = 0.4  #: Least share of the wire that has to be where it should be.
    largest_rival: float = 0.85  #: Largest score of another phase over the best one.
    seen_share: float = 0.5
    """Share of the frames on which a tail of another shape has to be readable, so that it counts as detected."""
    halves_agree: float = 0.13  #: Largest difference of a half tail's wavelength from that of the whole, over it.
    stretch_frames: int = 4  #: Fewest frames from which the apparent wavelength is taken.
    stretch_error: float = 0.006
    """Largest standard error of the apparent wavelength over that of the file that constrains the scale.

    On path-traced videos of painted and glass covers it was 0.0005 to 0.003."""
    offset: float = 0.3  #: Prior standard deviation of the tail's sideways offset, over the wire's apparent diameter.
    tilt: float = 0.02  #: Prior standard deviation of the tail's tilt, rad.
    floor: float = 0.004  #: Standard error of the phase by the tail's shape, rad.


@dataclass(frozen=True)
class UnwrappingConstants:
    """From angles modulo a period to continuous angles (`unwrapping`)."""

    largest_step: float = 0.45
    """Step from frame to frame, in periods, from which on its sense is doubtful; aliasing begins at 0.5."""
    least_order: float = 0.6  #: Least mean resultant length of the steps as unit vectors: less is no rotation.
    outlier: float = 0.3  #: Distance from the predicted angle, in periods, from which on a reading is an outlier.
    start: int = 40  #: Steps from which the first rate is found.
    lost: int = 6  #: Outliers in a row after which the rate is found anew.
    gain: float = 0.5  #: Share of a residual by which the predicted angle follows a reading.
    rate_gain: float = 0.08  #: Share of a residual by which the predicted rate follows a reading.
    drift: float = 0.05  #: Relative change of the rate that has to be expected over a gap.
    turning: float = 0.35  #: Least angle that counts as rotation when two senses of rotation are compared, rad.
    rest: float = 0.005  #: Least displacement, over the body's length, of something that is not part of the background.
    rest_angle: float = 0.02  #: Least rotation of something that is not part of the background, rad.
    seen_to_pass: float = radians(5.0)
    """Least rotation of the body, rad, while the tail makes `tail_turns`: with less, no stripe was seen to pass."""
    tail_turns: float = 2.0  #: Turns of the tail after which a free body has to have turned.
    leap: float = radians(25.0)
    """Deviation of a step of the body from the running median from which on it leaps, rad.

    On rendered videos with the right stripes the largest was 17 degrees, with seven, nine or ten for eight 50 and
    more."""
    leaps: int = 2  #: Leaps that show that stripes are misread.
    stray_rest: float = radians(10.0)
    """Deviation of the step from the reading before to that behind a stray one up to which it is alone, rad."""
    leap_window: int = 9  #: Steps of the running median.
    least_share: float = 0.1  #: Share of the frames on which angles have to be read.
    fewest_frames: int = 10  #: Frames on which something has to rest to be taken for part of the background.
    wall_factor: float = 1.5  #: Factor that walls may add to the largest advance of a helix in a turn.


@dataclass(frozen=True)
class LostFramesConstants:
    """Frames lost while the times go on evenly (`lost_frames`)."""

    fewest: int = 20  #: Fewest steps of a series for its usual step.
    windows: tuple[int, ...] = (1, 3, 5, 9)  #: Frames before and after a step whose medians are compared in turn.
    rounds: int = 30  #: Most rounds of correcting times and looking again, for each of them.
    around: int = 60  #: Frames through which the local slope is taken.
    most: int = 40  #: Most frames that may be lost in a row; beyond it, the video is cut.
    spike: float = 5.0
    """Distance from the neighbours' median, over the standard error of a step, from which on a frame is misread."""
    beyond: float = 3.0  #: Step over its standard error from which on it is no part of the local slope.
    clear: float = 30.0  #: Chi-square by which a loss has to fit better than none.
    apart: float = 12.0  #: Chi-square by which it has to fit better than any other number of frames.
    fits: float = 16.0  #: Largest chi-square of a loss that fits, for each series.
    largest_share: float = 0.35  #: Share of the steps with a loss from which on the usual step is not known.
    odd_share: float = 0.2  #: Unclear steps over clear losses from which on nothing is given.
    power: float = 50.0  #: Chi-square of the loss of one frame below which further ones may hide.
    told: float = 4.0  #: Size of all losses over the standard error from which on a series sees them.
    agrees: float = 0.15  #: Difference of a series from the size of the losses that is allowed in any case.
    tail_error: float = radians(0.5)  #: Least standard error of a step of the tail, rad.
    body_error: float = radians(0.1)  #: Least standard error of a step of the body, rad.
    place_error: float = 0.02  #: Least standard error of a step of the place, pixels.
    half: float = 0.5  #: Standard error of a loss that one series alone shows, over the loss.
    repeats: float = 16.0  #: Chi-square by which no motion has to fit better than any other step for a repeated frame.
    repeats_power: float = 25.0  #: Chi-square of the loss of one frame below which noise looks like repeated frames.
    stands: int = 5  #: Most repeated frames within as many steps to both sides; beyond it, the robot stands.
    standing: int = 12
    """Frames over which nothing moves where the robot stands, or everything the other way where it has reversed."""
    still: float = 0.4
    """Motion of a third of these frames over the usual one below which nothing moves, or which goes the other way."""
    repeats_error: float = 0.75
    """Standard error of the video's length by each repeated frame, frames: 0 or 1 is too much, some are not seen."""


@dataclass(frozen=True)
class MultiplesConstants:
    """Steps that are multiples of one (`lost_frames`)."""

    fewest: int = 30  #: Fewest steps for it.
    most: float = 12.0  #: Largest of them over the smallest.
    coherent: float = 0.4
    """Mean cosine of the steps over the smallest one, in turns: 1 where all are multiples, 0 where they are any."""
    share: float = 0.1  #: Share of the steps from which on a multiple is frequent.
    alike: float = 0.4  #: Difference of a step from the median step, over it, below which it is that step.
    changing: float = 0.2
    """Share of the steps that are another multiple than the one before, below which the motor changed its rate."""
    rest: int = 5  #: Most steps without motion in a row; beyond it, the robot stands.
    largest_share: float = 0.3
    """Lost or repeated frames over the steps from which on nothing is given: rates may be wrong by a factor."""


@dataclass(frozen=True)
class VisibilityConstants:
    """Second robots, wrong directions, gaps, robots that leave, and glare (`warnings`)."""

    second: float = 0.75  #: Score of a second robot over that of the first.
    second_clear: float = 1.3  #: Score of a second robot over that of the next best place.
    maybe_turned: float = 0.85
    """Score of a robot the other way round over that of the stated direction from which on more frames are tested."""
    turned: float = 1.05  #: Score of a robot the other way round over the stated direction's from which it is flagged.
    often: float = 0.6  #: Share of the frames on which a second robot has to be seen.
    asked: int = 3  #: Stride of the frames on which the body turned by 180 degrees is tried first.
    lost: float = 0.03  #: Share of frames without the robot that is flagged.
    full_view: float = 0.97  #: Share of the edges in the picture below which the robot is partly out of view.
    enough: float = 0.2  #: Share of frames in full view from which on the others are left out.
    hidden: float = 0.55  #: Share of the edges that fit below which glare, shadows or bubbles are flagged.


OUTLINE = OutlineConstants()
SEAL = SealConstants()
DETECTION = InitialDetectionConstants()
SIZE = SizeConstants()
IDENTITY = IdentityConstants()
SETUP_FREE = SetupFreeConstants()
STANDING = StandingConstants()
STRIPES = StripeConstants()
SINGLE_LINE = SingleLineConstants()
TAIL = TailConstants()
UNWRAPPING = UnwrappingConstants()
LOST_FRAMES = LostFramesConstants()
MULTIPLES = MultiplesConstants()
VISIBILITY = VisibilityConstants()
