"""Checks for darkness before charging, from the light in the dark frames."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError, DeviceError
from labrig.foundation.quantity import duration_text
from labrig.reduce import is_clipped

from .exposure_metering import MeteringFrame

#: Largest error of a camera's black level, as a fraction of the range from black to white.
BLACK_ERROR = 0.005
#: No sensor makes more in the dark, per second at ISO 100, as a fraction of the range: 10 electrons
#: of some 60 000. A 5D Mark II comes to that at 50 °C.
DARK_CURRENT_PER_S = 2e-4
#: Fraction of the range from which light is too bright to be subtracted by dark frames.
BRIGHT = 0.25
#: Fading of a glow along the dark frames; shutters flicker by a third of it.
FADED = 0.03


@dataclass(frozen=True)
class Darkness:
    """Light that is left before charging.

    Attributes
    ----------
    light
        Fraction of the range that the light fills in `exposure_s` seconds, beyond the dark current:
        0 is dark, 1 clips.
    exposure_s
        Longest shutter time of the dark frames.
    fades
        Whether the light decreases from frame to frame, as a glow does and a lamp does not.
    """

    light: float
    exposure_s: float
    fades: bool

    def __str__(self) -> str:
        if not self.light:
            return "dark"
        fading = ", fading" if self.fades else ""
        return f"{100 * self.light:.1f} % of the range in {duration_text(self.exposure_s)}{fading}"

    @property
    def is_bright(self) -> bool:
        """Whether the light is too bright to be subtracted by dark frames."""
        return self.light >= BRIGHT

    @property
    def is_doubtful(self) -> bool:
        """Whether the light may be a lamp, or a glow that fades too slowly for these frames."""
        return self.is_bright and not self.fades

    def require(self, warn: Callable[[str], None]) -> None:
        """Refuse light in which nothing can be measured, and warn of light that can be subtracted.

        Raises
        ------
        DeviceError
            A light is on: the lamp may be, which is unsafe.
        DataError
            The sample still glows too brightly.
        """
        if self.is_doubtful:
            raise DeviceError(
                f"the dark frames are not dark ({self}) and do not fade: a light is on in the "
                "room, or the lamp is on although its relay reads off: look, switch it off or "
                "pull its plug"
            )
        if self.is_bright:
            raise DataError(
                f"the sample still glows too brightly for dark frames ({self}); leave it in the "
                "dark for longer"
            )
        if self.light and self.fades:
            warn(
                f"the sample still glows from earlier ({self}): the dark frames hold some of it; "
                "longer in the dark before a run is better"
            )
        elif self.light:
            warn(
                f"the dark frames are not dark ({self}): some light is left, or the sample still "
                "glows; it is subtracted as long as it stays the same"
            )


DARK = Darkness(0.0, 0.0, fades=False)


def darkness(frames: Sequence[MeteringFrame], iso: int) -> Darkness:
    """Return the light in dark frames beyond the dark current.

    The level of the shortest exposure is taken as black, so that neither a wrong black level in a
    file nor a hot pixel looks like light; with one exposure, the file's black level.
    """
    shortest_s = min(frame.exposure_s for frame in frames)
    longest_s = max(frame.exposure_s for frame in frames)
    open_s = max(
        (frame.exposure_s for frame in frames if not clips(frame)),
        default=0.0,
    )
    if not open_s:
        return Darkness(1.0, longest_s, fades=False)
    shortest = [frame for frame in frames if frame.exposure_s == shortest_s]
    black = _black(shortest, has_longer=shortest_s < open_s)
    series = [levels(frame) - black for frame in frames if frame.exposure_s == open_s]
    brightest = np.argmax(series[0])
    level = np.array([level_dn.flat[brightest] for level_dn in series]) / range_dn(frames[0])
    half = max(len(level) // 2, 1)
    fades = bool(level[-half:].mean() < (1 - FADED) * level[:half].mean())
    light = float(level.mean()) if open_s == longest_s else 1.0
    if light < BLACK_ERROR + DARK_CURRENT_PER_S * longest_s * iso / 100:
        return DARK
    return Darkness(light, longest_s, fades)


def _black(shortest: Sequence[MeteringFrame], has_longer: bool) -> FloatArray:
    """Return the level without light, in DN above the file's black level."""
    mean: FloatArray = np.mean([levels(frame) for frame in shortest], axis=0)
    has_black_level = max(shortest[0].patches[0].black) > 0
    return mean if has_longer or not has_black_level else np.zeros_like(mean)


def levels(frame: MeteringFrame) -> FloatArray:
    """Return means in DN above black, shape (patches, channels)."""
    return np.array(
        [[channel.mean for channel in patch.channels.values()] for patch in frame.patches]
    )


def clips(frame: MeteringFrame) -> bool:
    """Return whether some channel of some patch clips.

    Isolated bright pixels are hot: in a small patch a single one exceeds the limit for clipping,
    and it is saturated in a long exposure in any darkness.
    """
    return any(
        is_clipped(max(channel.saturated - (channel.hot or 0), 0), channel.n)
        for patch in frame.patches
        for channel in patch.channels.values()
    )


def range_dn(frame: MeteringFrame) -> float:
    """Return the range from black to white, in DN."""
    return frame.patches[0].range_dn
