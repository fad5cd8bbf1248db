"""Spectral frames as a screen shows them, with one exposure or each with its own."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from labrig.errors import UsageError
from labrig.reproduce.picture.display import Display, tristimulus
from labrig.reproduce.picture.exr import SpectralFrame
from labrig.reproduce.picture.night import NightLook, night_view

Bytes = NDArray[np.uint8]

EACH, COMMON = "each", "common"
#: Percentage of the pixels that are not brighter than white; lamps and their reflections are.
UNCLIPPED_PER_CENT = 96.0


def shown_frames(
    frames: Sequence[SpectralFrame], exposure: str = EACH, night: bool = False
) -> list[tuple[Bytes, Display]]:
    """Return frames in sRGB, each with the transform that made it.

    Parameters
    ----------
    frames
        Spectral frames with absolute radiances.
    exposure
        `each`: each frame has an exposure that shows most of its pixels; `common`: that of the
        brightest for all; or the luminance in cd/m² that is white, as text.
    night
        Whether they are to look as in the dark, see `NightLook`.

    Returns
    -------
    list of tuple
        Pictures (height, width, 3) and their transforms. A frame that is all dark is black, and has
        the transform of 1 cd/m².

    Raises
    ------
    UsageError
        The exposure is none of these.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.reproduce import SpectralFrame, shown_frames
    >>> edges_nm = np.linspace(300, 780, 25)
    >>> bright = SpectralFrame(np.full((4, 4, 24), 1e-3, np.float32), edges_nm, "", {})
    >>> (picture, display), = shown_frames([bright])
    >>> picture.shape, f"{display.white_luminance:.0f} cd/m² is white"
    ((4, 4, 3), '88 cd/m² is white')
    """
    xyz = [tristimulus(frame.radiance, frame.edges_nm) for frame in frames]
    displays = _displays(xyz, exposure)
    if not night:
        return [(display.shown(each), display) for each, display in zip(xyz, displays, strict=True)]
    pictures = []
    for number, (frame, display) in enumerate(zip(frames, displays, strict=True)):
        look = NightLook(seed=number)
        used = display
        if exposure == EACH and xyz[number].any():
            # The rods' luminance is several times that of the cones: it has its own exposure.
            dark, _ = night_view(frame.radiance, frame.edges_nm, look)
            used = Display.automatic(dark, UNCLIPPED_PER_CENT)
        seen, used = night_view(frame.radiance, frame.edges_nm, look, used)
        pictures.append((used.shown(seen), used))
    return pictures


def check_exposure(exposure: str) -> None:
    """Refuse what is no exposure.

    Parameters
    ----------
    exposure
        As `shown_frames` takes it.

    Raises
    ------
    UsageError
        It is none.

    Examples
    --------
    >>> from labrig.reproduce import check_exposure
    >>> check_exposure("common")
    """
    if exposure not in (EACH, COMMON):
        _given(exposure)


def _given(exposure: str) -> Display:
    try:
        return Display(float(exposure))
    except ValueError:
        raise UsageError(
            f"expected an exposure '{EACH}', '{COMMON}' or the luminance of white in cd/m², got "
            f"'{exposure}'"
        ) from None


def _displays(xyz: Sequence[NDArray[np.float64]], exposure: str) -> list[Display]:
    if exposure == EACH:
        return [
            Display.automatic(each, UNCLIPPED_PER_CENT) if each.any() else Display(1.0)
            for each in xyz
        ]
    if exposure == COMMON:
        brightest = max(xyz, key=lambda each: float(each[..., 1].mean()))
        display = (
            Display.automatic(brightest, UNCLIPPED_PER_CENT) if brightest.any() else Display(1.0)
        )
        return [display] * len(xyz)
    return [_given(exposure)] * len(xyz)
