"""Checks that frames after lamp off show a glow: visible, fading, as bright as expected.

The relay reports its register only. Whether the lamp lit, and whether it went out, is seen in the
frames.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.detection import DETECTION_SIGMA
from labrig.foundation.errors import DeviceError

from .darkness import clips, levels
from .exposure_metering import MeteringFrame

SEEN_DN = 1.0
#: Time in which every phosphor that was just charged fades by more than two per cent.
MIN_S = 10.0
FADED = 0.02
#: Fraction by which a frame is darker without the lamp: more than two exposures scatter, and more
#: than a glow without any lamp fades from one to the other.
DARKER = 0.2
#: Fading between two checks `LOOK_AGAIN_S` apart, which are made in doubt.
FADED_IN_DOUBT = 0.05
LOOK_AGAIN_S = 60.0
#: Largest noise of two levels that can be compared.
MAX_NOISE = 0.01
#: Number of shutter times at the start of the ladder that are too short for a glow to clip.
SHORT = 3
#: A glow that stays level in the second half of a decay at more than this fraction of its first
#: frame may be another light.
LINGERING = 0.2
#: Increase from the first to the second frame that flicker and noise do not cause.
RISEN = 0.1
#: Fraction of the earlier glow below which the sample was not charged like before.
WEAK = 0.5


class Afterglow(Enum):
    """Classification of the frames after lamp off."""

    FADING = "fading"
    LINGERING = "fading to a level that stays"
    CLIPPED = "too bright to see it fade"
    ABSENT = "no glow"
    WEAK = "weaker than before"
    STEADY = "not fading"
    RISING = "brighter in the second frame than in the first"

    def __str__(self) -> str:
        return self.value

    def require(self, warn: Callable[[str], None]) -> None:
        """Refuse a series that is no decay of a charged sample, and warn of doubtful ones.

        Raises
        ------
        DeviceError
            The series is refused; the message names what to check.
        """
        if self in _ERRORS:
            raise DeviceError(_ERRORS[self])
        if self in _WARNINGS:
            warn(_WARNINGS[self])


_ERRORS = {
    Afterglow.ABSENT: "nothing glows after the charge: the lamp did not light (check its bulb, its "
    "plug and the contact of its relay), a trap door did not open, or the patches hold nothing "
    "that glows at these settings (raise camera.iso or open the aperture)",
    Afterglow.RISING: "the second photograph after lamp off is brighter than the first: a trap "
    "door opens too slowly or gets stuck (look at it; if it always is that slow, raise its "
    "'travel:' in the rig file and 'first:'), or another light came on",
    Afterglow.STEADY: "the light does not fade after lamp off: the lamp is still on "
    "although its relay reads off (pull its plug, the contact may be welded), or another light "
    "is on",
}


_WARNINGS = {
    Afterglow.WEAK: "the glow is less than half as bright as before: the lamp may have gone out "
    "while charging or stayed on too long before (check its bulb and its relay), or lamp, sample "
    "or camera was moved; amplitudes are not to be trusted",
    Afterglow.LINGERING: "the second half of the decay stays at one level: a light may have come "
    "on, or a state lives much longer than the decay was recorded",
}


@dataclass(frozen=True)
class Glow:
    """One frame after lamp off, in DN per second of all channels of all patches, above darkness.

    Attributes
    ----------
    at_s
        Middle of the exposure in seconds after the planned start of the first frame.
    exposure_s
        Shutter time in seconds.
    rate, sigma
        Signal and its standard uncertainty in DN/s, shape (patches × channels,).
    clips
        Whether some channel of some patch clips.
    """

    at_s: float
    exposure_s: float
    rate: FloatArray
    sigma: FloatArray
    clips: bool

    @property
    def brightest(self) -> float:
        """Rate of the brightest channel of the brightest patch, in DN/s."""
        return float(self.rate.max())

    @property
    def seen(self) -> bool:
        """Whether any light is detected."""
        limit = np.maximum(DETECTION_SIGMA * self.sigma, SEEN_DN / self.exposure_s)
        return self.clips or bool(np.any(self.rate > limit))


def glow(frame: MeteringFrame, dark: FloatArray, zero_s: float) -> Glow:
    """Return a frame's signal above the level `dark`, of shape (patches, channels), in DN."""
    sigma = np.array(
        [[channel.sigma for channel in patch.channels.values()] for patch in frame.patches]
    )
    return Glow(
        at_s=frame.start_s + frame.exposure_s / 2 - zero_s,
        exposure_s=frame.exposure_s,
        rate=((levels(frame) - dark) / frame.exposure_s).ravel(),
        sigma=(sigma / frame.exposure_s).ravel(),
        clips=clips(frame),
    )


def dark_level(darks: Sequence[MeteringFrame], exposure_s: float) -> FloatArray:
    """Return the level of dark frames at that shutter time, interpolated between those taken."""
    times_s = sorted({frame.exposure_s for frame in darks})
    mean = np.array(
        [
            np.mean(
                [levels(frame) for frame in darks if frame.exposure_s == time_s],
                axis=0,
            )
            for time_s in times_s
        ]
    )
    return np.apply_along_axis(lambda level: np.interp(exposure_s, times_s, level), 0, mean)


def classify_ladder(glows: Sequence[Glow]) -> Afterglow:
    """Classify a ladder of exposures, by rising shutter time."""
    if not any(glow.seen for glow in glows):
        return Afterglow.ABSENT
    if any(glow.clips for glow in glows[:SHORT]):
        return Afterglow.CLIPPED
    return Afterglow.FADING


def classify_decay(
    first: Sequence[Glow], middle: Glow, last: Sequence[Glow], reference: Sequence[Glow]
) -> Afterglow:
    """Classify some frames of a decay.

    Parameters
    ----------
    first, middle, last
        Frames of the start, the middle and the end of the decay.
    before
        Frames of the metering or of an earlier decay, with which the first frame is compared.
    """
    start, end = first[0], last[-1]
    if not any(glow.seen for glow in first):
        return Afterglow.ABSENT
    if end.clips:
        return Afterglow.CLIPPED
    if start.clips:
        return Afterglow.FADING
    if first[-1].brightest > (1 + RISEN) * start.brightest and first[-1].seen:
        return Afterglow.RISING
    if start.brightest < WEAK * _expected(start, reference):
        return Afterglow.WEAK
    if _is_steady(first, last, FADED):
        return Afterglow.STEADY
    lingers = end.brightest > LINGERING * start.brightest and _is_steady([middle], last, FADED)
    return Afterglow.LINGERING if lingers else Afterglow.FADING


def classify_repeats(frames: Sequence[Glow], repeats: Sequence[Glow]) -> Afterglow:
    """Classify doubtful frames by repeating their shutter times after a while."""
    pairs = [pair for pair in zip(frames, repeats, strict=True) if not pair[0].clips]
    if not pairs:
        return Afterglow.STEADY
    frame, repeat = pairs[-1]
    steady = repeat.clips or _is_steady([frame], [repeat], FADED_IN_DOUBT)
    return Afterglow.STEADY if steady else Afterglow.FADING


def has_gone_out(under_lamp: Glow, after_lamp_off: Glow) -> bool:
    """Return whether a frame after lamp off is darker than the same under the lamp."""
    brightest = int(np.argmax(under_lamp.rate))
    if under_lamp.clips or not under_lamp.seen:
        return not after_lamp_off.clips
    return bool(after_lamp_off.rate[brightest] < (1 - DARKER) * under_lamp.rate[brightest])


def _is_steady(first: Sequence[Glow], last: Sequence[Glow], faded: float) -> bool:
    """Return whether the brightest channel has certainly not faded by that fraction."""
    brightest = int(np.argmax(first[0].rate))
    first_rate = float(np.mean([glow.rate[brightest] for glow in first]))
    last_rate = float(np.mean([glow.rate[brightest] for glow in last]))
    noise = max(float(glow.sigma[brightest]) for glow in (*first, *last))
    long_enough = last[-1].at_s - first[0].at_s > MIN_S
    return long_enough and noise < MAX_NOISE * first_rate and last_rate > (1 - faded) * first_rate


def _expected(first: Glow, reference: Sequence[Glow]) -> float:
    """Return the brightest channel's rate at that time, log-linear between earlier frames; or 0."""
    brightest = int(np.argmax(first.rate))
    detected = [
        glow for glow in reference if glow.seen and not glow.clips and glow.rate[brightest] > 0
    ]
    if not detected:
        return 0.0
    log_rate = np.log([glow.rate[brightest] for glow in detected])
    return float(np.exp(np.interp(first.at_s, [glow.at_s for glow in detected], log_rate)))
