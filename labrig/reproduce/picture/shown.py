"""Spectral frames as a screen shows them, with one exposure or each with its own."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from labrig.foundation.errors import UsageError
from labrig.optics import Spectrum
from labrig.reproduce.picture.display import Display, White, is_white, tristimulus
from labrig.reproduce.picture.exr import SpectralFrame
from labrig.reproduce.picture.night import NightLook, night_view

Bytes = NDArray[np.uint8]

EACH, COMMON = "each", "common"
#: Percentage of the pixels that are not brighter than white; lamps and their reflections are.
UNCLIPPED_PER_CENT = 96.0


def shown_frames(
    frames: Sequence[SpectralFrame],
    exposure: str | float = EACH,
    night: bool = False,
    adapted_white: White | None = None,
) -> list[tuple[Bytes, Display]]:
    """Return frames in sRGB, each with the transform that made it.

    Parameters
    ----------
    frames
        Spectral frames with absolute radiances.
    exposure
        `each`: each frame has an exposure that shows most of its pixels; `common`: that of the
        brightest for all; or the luminance in cd/m² that is white.
    night
        Whether they are to look as in the dark, see `NightLook`.
    adapted_white
        X, Y, Z of what is to look white, as of `white_under`; None for D65. Eyes that see in the
        dark are adapted to no lamp: it does not count for them.

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
    displays = _displays(xyz, exposure, None if night else adapted_white)
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


def white_under(light: Spectrum, edges_nm: ArrayLike) -> White:
    """Return what looks white in a light: a surface that returns all of it.

    Parameters
    ----------
    light
        Spectrum of the light.
    edges_nm
        Rising edges of the bands of a picture in nm, shape (bands + 1,): white is white in them.

    Returns
    -------
    tuple of float
        X, Y, Z with Y = 1, for `Display` and `shown_frames`.

    Raises
    ------
    UsageError
        It is no light to which eyes adapt, such as ultraviolet or a narrow blue.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.optics import illuminant
    >>> from labrig.reproduce import white_under
    >>> [round(value, 3) for value in white_under(illuminant("A"), np.linspace(380, 780, 41))]
    [1.098, 1.0, 0.356]
    """
    xyz = tristimulus(light.in_bands(np.asarray(edges_nm)), edges_nm)
    if xyz[1] > 0:
        x, y, z = (xyz / xyz[1]).tolist()
        if is_white((x, y, z)):
            return (x, y, z)
    raise UsageError(
        f"expected a light in which a white surface looks white, such as D65, D50 or A, got "
        f"{light.name}"
    )


def _displays(
    xyz: Sequence[NDArray[np.float64]], exposure: str | float, adapted: White | None
) -> list[Display]:
    if exposure == EACH:
        return [_automatic(each, adapted) for each in xyz]
    if exposure == COMMON:
        brightest = max(xyz, key=lambda each: float(each[..., 1].mean()))
        return [_automatic(brightest, adapted)] * len(xyz)
    try:
        return [Display(float(exposure), adapted)] * len(xyz)
    except ValueError:
        raise UsageError(
            f"expected an exposure '{EACH}', '{COMMON}' or the luminance of white in cd/m², got "
            f"'{exposure}'"
        ) from None


def _automatic(xyz: NDArray[np.float64], adapted: White | None) -> Display:
    """Return the display of a picture at its best, that of 1 cd/m² for one that is all dark."""
    if not xyz.any():
        return Display(1.0, adapted)
    return Display.automatic(xyz, UNCLIPPED_PER_CENT, adapted)
