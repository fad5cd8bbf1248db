"""Spectral frames as a screen shows them, with one exposure or each with its own.

The look of night is that of W. B. Thompson, P. Shirley and J. A. Ferwerda, A Spatial
Post-Processing Algorithm for Images of Night Scenes, Journal of Graphics Tools 7(1), 2002, but with
the rods' luminance from the spectra and not from X, Y, Z. It is an appearance, for people who look
at a screen in a lit room; it measures nothing.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.optics import Spectrum, band_integrals, scotopic_efficacy
from labrig.reproduce.picture.display import Display, White, is_white, tristimulus, weighted_bands
from labrig.reproduce.picture.exr import SpectralFrame

#: Luminances in cd/m² below which rods see alone, and above which cones do.
RODS_ALONE_CD_PER_M2, CONES_ALONE_CD_PER_M2 = 0.01, 10.0
#: The wider Gaussian of a difference of Gaussians over the narrower.
_WIDER = 1.6
#: Chromaticities x = y of equal energy and of the bluish grey of night.
_GREY, _BLUE = 1 / 3, 1 / 4


@dataclass(frozen=True)
class NightLook:
    """Parameters of the look of a night.

    Parameters
    ----------
    rods
        Share k of the rods, 0 to 1, the same for all pixels, as relative images need it. None: by
        the luminance Y of each pixel in cd/m², linear in log Y from 1 at 0.01 to 0 at 10 cd/m².
    blue_shift
        Shift b from grey to blue of what rods see alone, 0 to 1.
    blur_px
        Standard deviation s of the narrower Gaussian in pixels, ≥ 0.
    sharpening
        Exponent γ > 0 of the edges: 1 keeps what the narrower Gaussian leaves, more emphasises weak
        edges.
    noise
        Standard deviation of the noise relative to white, ≥ 0.
    seed
        Seed of the noise.

    Raises
    ------
    UsageError
        A parameter is outside of its range.

    Examples
    --------
    >>> from labrig.reproduce import NightLook
    >>> NightLook(rods=0.8).sharpening
    1.25
    """

    rods: float | None = None
    blue_shift: float = 0.5
    blur_px: float = 1.6
    sharpening: float = 1.25
    noise: float = 0.0125
    seed: int = 0

    def __post_init__(self) -> None:
        for name, value in (("rods", self.rods), ("blue_shift", self.blue_shift)):
            if value is not None and not 0 <= value <= 1:
                raise UsageError(f"{name}: expected a share from 0 to 1, got {value:g}")
        for name, value in (("blur_px", self.blur_px), ("noise", self.noise)):
            if not 0 <= value < np.inf:
                raise UsageError(f"{name}: expected a number ≥ 0, got {value:g}")
        if not 0 < self.sharpening < np.inf:
            raise UsageError(f"sharpening: expected an exponent above 0, got {self.sharpening:g}")
        if self.seed < 0:
            raise UsageError(f"seed: expected a number ≥ 0, got {self.seed}")

    def share_of_rods(self, luminance: ArrayLike) -> FloatArray:
        """Return k for luminances in cd/m², of the same shape."""
        y = np.asarray(luminance, dtype=np.float64)
        if self.rods is not None:
            return np.full(y.shape, self.rods)
        low, high = np.log10([RODS_ALONE_CD_PER_M2, CONES_ALONE_CD_PER_M2])
        exponent = np.log10(np.maximum(y, RODS_ALONE_CD_PER_M2))
        return np.asarray(np.clip((high - exponent) / (high - low), 0.0, 1.0))


def scotopic_luminance(radiance: ArrayLike, edges_nm: ArrayLike) -> FloatArray:
    """Return the luminance V of a spectral image for the rods, by V′(λ) of CIE 1951.

    Parameters
    ----------
    radiance
        Mean radiance in each band in W m⁻² sr⁻¹ nm⁻¹ or relative, shape (…, bands).
    edges_nm
        Rising edges of the bands in nm, shape (bands + 1,).

    Returns
    -------
    ndarray
        Scotopic luminance in cd/m² (1700 lm/W at 507 nm), shape (…).

    Raises
    ------
    UsageError
        The bands do not fit the image, or a radiance is not finite.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.reproduce import scotopic_luminance, tristimulus
    >>> edges_nm = np.linspace(300, 780, 25)
    >>> equal_energy = np.full(24, 1e-3)
    >>> luminance = tristimulus(equal_energy, edges_nm)[1]
    >>> f"{scotopic_luminance(equal_energy, edges_nm) / luminance:.2f}"
    '2.26'
    """
    edges = np.asarray(edges_nm, dtype=np.float64)
    table_nm = np.arange(300.0, 831.0)
    weights = band_integrals(table_nm, scotopic_efficacy(table_nm)[:, np.newaxis], edges)
    return np.asarray(weighted_bands(radiance, edges, weights)[..., 0])


def night_view(
    radiance: ArrayLike, edges_nm: ArrayLike, look: NightLook, display: Display | None = None
) -> tuple[FloatArray, Display]:
    """Return what is seen of a spectral image at night.

    Of a pixel with luminance Y, chromaticity (x, y) and the rods' share k, it is Y′ = (1 − k) Y +
    k V and x′ = (1 − k) x + k/3, x″ = (1 − k b) x′ + k b/4, and y alike. Relative to white, Y′ is
    blurred by Gaussians of s and 1.6 s into G₁ and G₂, d = G₁ − G₂, and becomes
    G₂ + sign(d) abs(d)^(1/γ) + noise where rods see alone; in between it is mixed with Y′ by k.

    Parameters
    ----------
    radiance
        Mean radiance in each band in W m⁻² sr⁻¹ nm⁻¹, or relative with `rods` given, shape (height,
        width, bands).
    edges_nm
        Rising edges of the bands in nm, shape (bands + 1,).
    look
        Parameters of the look.
    display
        Display whose white is that of noise and edges; None for automatic exposure of Y′.

    Returns
    -------
    xyz : ndarray
        X, Y, Z of what is seen, shape (height, width, 3).
    display : Display
        Display on which it is to be shown.

    Raises
    ------
    UsageError
        The bands do not fit the image, a radiance is not finite, or all is dark and there is no
        display.

    References
    ----------
    W. B. Thompson, P. Shirley and J. A. Ferwerda, *A spatial post-processing algorithm for images
    of night scenes*, Journal of Graphics Tools 7(1), 2002. There, k and b are those of a picture;
    that both grow with k from pixel to pixel, so that a lit place keeps its look, is labrig's.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.reproduce import NightLook, night_view
    >>> edges_nm = np.linspace(300, 780, 25)
    >>> starlight = np.full((4, 4, 24), 1e-8)
    >>> xyz, display = night_view(starlight, edges_nm, NightLook(noise=0.0))
    >>> f"{display.white_luminance:.4f} cd/m², {xyz[0, 0, 2] / xyz[0, 0, 1]:.2f}"
    '0.0022 cd/m², 1.43'
    """
    xyz = tristimulus(radiance, edges_nm)
    if xyz.ndim != 3:
        raise UsageError(f"expected an image (height, width, bands), got {xyz.ndim} dimensions")
    share = look.share_of_rods(xyz[..., 1])
    luminance = (1 - share) * xyz[..., 1] + share * scotopic_luminance(radiance, edges_nm)
    chromaticity = _night_chromaticity(xyz, share, look.blue_shift)
    if display is None:
        display = Display.automatic(_from_chromaticity(chromaticity, luminance))
    white = display.white_luminance
    blurred = white * _by_rods(luminance / white, look)
    luminance = (1 - share) * luminance + share * blurred
    return _from_chromaticity(chromaticity, luminance), display


def _night_chromaticity(xyz: FloatArray, share: FloatArray, blue_shift: float) -> FloatArray:
    """Return x″, y″ of X, Y, Z (…, 3), shape (…, 2); black is grey."""
    total = xyz.sum(axis=-1, keepdims=True)
    seen = np.where(total > 0, xyz[..., :2] / np.where(total > 0, total, 1.0), _GREY)
    k = share[..., np.newaxis]
    b = blue_shift * k
    grey = (1 - k) * seen + k * _GREY
    return np.asarray((1 - b) * grey + b * _BLUE)


def _from_chromaticity(chromaticity: FloatArray, luminance: FloatArray) -> FloatArray:
    """Return X, Y, Z of x, y (…, 2) and Y (…)."""
    x, y = np.moveaxis(chromaticity, -1, 0)
    # y = 0 has no luminance: extreme violet of a relative image.
    per_y = luminance / np.maximum(y, np.finfo(float).tiny)
    return np.where(
        (luminance > 0)[..., np.newaxis],
        np.stack([x * per_y, luminance, (1 - x - y) * per_y], axis=-1),
        0.0,
    )


def _by_rods(relative: FloatArray, look: NightLook) -> FloatArray:
    """Return a luminance relative to white (height, width) with the acuity and noise of rods."""
    # slow to load
    from scipy.ndimage import gaussian_filter

    narrow, wide = (
        gaussian_filter(relative, sigma, mode="nearest")
        for sigma in (look.blur_px, _WIDER * look.blur_px)
    )
    edge = narrow - wide
    noise = np.random.default_rng(look.seed).normal(0.0, look.noise, relative.shape)
    seen = wide + np.sign(edge) * np.abs(edge) ** (1 / look.sharpening) + noise
    return np.maximum(seen, 0.0)


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
