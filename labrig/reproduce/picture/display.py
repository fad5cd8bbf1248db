"""From a spectral image to a picture on a screen, by a transform that can be stated in a line.

A spectral image holds the mean radiance of each pixel in each band, shape (height, width, bands),
its top row first. Its sensor is the CIE 1931 2° observer or a camera; a display transform makes
bytes of the observer's X, Y, Z.
"""

from dataclasses import dataclass
from typing import Self, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.foundation.number_format import rounded
from labrig.optics import (
    CIE_1931,
    XYZ_TO_SRGB,
    CameraResponse,
    band_integrals,
    from_oklab,
    observer,
    oklab,
    photopic_efficacy,
    srgb_bytes,
)

Bytes = NDArray[np.uint8]
White: TypeAlias = tuple[float, float, float]

#: Percentage of the pixels that are not black which automatic exposure shows unclipped.
UNCLIPPED_PER_CENT = 99.5

#: X, Y, Z to the responses of Bradford's transform (CIE 159:2004, from Lam, 1985).
BRADFORD = np.array(
    [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]]
)

_WHITE_LAB = np.array([1.0, 0.0, 0.0])
#: How many times brighter than the screen a colour is, less one, where it is half white.
HALF_WHITE = 8.0


def tristimulus(radiance: ArrayLike, edges_nm: ArrayLike) -> FloatArray:
    """Return X, Y, Z of a spectral image for the CIE 1931 2° observer.

    The colour-matching functions are integrated over each band, which is exact for spectra that are
    constant within the bands. Bands of 20 nm displace smooth reflectances under daylight by
    ΔE2000 ≤ 0.7, bands of 10 nm by ≤ 0.2.

    Parameters
    ----------
    radiance
        Mean radiance in each band in W m⁻² sr⁻¹ nm⁻¹ or relative, shape (…, bands).
    edges_nm
        Rising edges of the bands in nm, shape (bands + 1,).

    Returns
    -------
    ndarray
        X, Y, Z, shape (…, 3), where Y is the luminance in cd/m², or 683 lm/W times the unit of a
        relative radiance.

    Raises
    ------
    UsageError
        The bands do not fit the image, or a radiance is not finite.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.reproduce import tristimulus
    >>> edges_nm = np.linspace(300, 780, 25)
    >>> equal_energy = np.full((2, 3, 24), 1e-3)
    >>> tristimulus(equal_energy, edges_nm)[0, 0].round(1).tolist()
    [73.0, 73.0, 73.0]
    """
    eye = observer(CIE_1931)
    lumens_per_watt = float(photopic_efficacy(555.0))
    weights = lumens_per_watt * band_integrals(
        eye.wavelength_nm, eye.functions, np.asarray(edges_nm, dtype=np.float64)
    )
    return weighted_bands(radiance, edges_nm, weights)


def camera_values(radiance: ArrayLike, edges_nm: ArrayLike, camera: CameraResponse) -> FloatArray:
    """Return what a camera records of a spectral image, linear and not white balanced.

    Parameters
    ----------
    radiance
        Mean radiance in each band, shape (…, bands).
    edges_nm
        Rising edges of the bands in nm, shape (bands + 1,).
    camera
        Spectral sensitivities of the camera.

    Returns
    -------
    ndarray
        Signals on the scale of the sensitivities times nm, shape (…, channels).

    Raises
    ------
    UsageError
        The bands do not fit the image, or a radiance is not finite.

    Examples
    --------
    >>> import numpy as np
    >>> import labrig
    >>> from labrig.reproduce import camera_values
    >>> edges_nm = np.linspace(300, 780, 25)
    >>> green = np.zeros(24)
    >>> green[11] = 1.0  # 520 to 540 nm
    >>> camera_values(green, edges_nm, labrig.read_camera("canon_eos_5d_mark_ii")).round(1).tolist()
    [3.1, 19.7, 2.3]
    """
    weights = band_integrals(
        camera.wavelength_nm, camera.sensitivity, np.asarray(edges_nm, dtype=np.float64)
    )
    return weighted_bands(radiance, edges_nm, weights)


def weighted_bands(radiance: ArrayLike, edges_nm: ArrayLike, weights: FloatArray) -> FloatArray:
    """Return the sums over bands of a checked image with weights (bands, k), shape (…, k)."""
    pixels = np.asarray(radiance)
    edges = np.asarray(edges_nm, dtype=np.float64)
    if edges.ndim != 1 or len(edges) < 2 or not (np.diff(edges) > 0).all():
        raise UsageError("expected rising edges of bands in nm, got others")
    if pixels.shape[-1:] != (len(edges) - 1,):
        raise UsageError(
            f"expected an image of {len(edges) - 1} bands, as there are edges, got the shape "
            f"{pixels.shape}"
        )
    # An image of 32-bit numbers is not copied to 64 bits first.
    kind = pixels.dtype if pixels.dtype == np.float32 else np.dtype(np.float64)
    with np.errstate(invalid="ignore"):
        sums = np.asarray(pixels @ weights.astype(kind), dtype=np.float64)
    if not np.isfinite(sums).all():
        raise UsageError("expected finite radiances, got NaN or infinite ones")
    return sums


@dataclass(frozen=True)
class Display:
    """Transform from X, Y, Z to 8-bit sRGB, the same for all pixels.

    X, Y, Z are divided by the luminance of the screen's white, and become linear sRGB. D65 is
    white; another white is adapted to it by Bradford's transform. A colour that no screen shows, as
    it is more saturated, is mixed with the grey of its own luminance until it fits. One that is
    brighter than the screen keeps its hue: it has the brightest colour of its chromaticity, and
    turns to white of the same hue (in Oklab) where it is many times brighter. The curve is that of
    IEC 61966-2-1.

    Parameters
    ----------
    white_luminance
        Luminance that is the screen's white, above 0, in cd/m² or the unit of a relative Y.
    adapted_white
        X, Y, Z, on any scale, of what is to look white, such as a white surface under the lamp to
        which eyes are used; None for D65.

    Raises
    ------
    UsageError
        The luminance or the white is not above 0 or not finite.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.reproduce import Display
    >>> display = Display(white_luminance=80.0)
    >>> grey, outside_of_the_gamut = [37.95, 40.0, 43.4], [0.0, 8.0, 0.0]
    >>> display.shown(np.array([grey, outside_of_the_gamut])).tolist()
    [[187, 188, 187], [0, 103, 65]]
    >>> display.shown(np.array([20.0, 40.0, 200.0])).tolist()  # a blue light
    [19, 194, 255]
    """

    white_luminance: float
    adapted_white: White | None = None

    def __post_init__(self) -> None:
        if self.adapted_white is not None and not is_white(self.adapted_white):
            raise UsageError(
                "expected X, Y and Z, above 0 and finite, of a white to which eyes adapt, got "
                f"{tuple(round(value, 4) for value in self.adapted_white)}"
            )
        if not 0 < self.white_luminance < np.inf:
            raise UsageError(
                "expected the luminance of white above 0 and finite, got "
                f"{self.white_luminance:g}; a picture that is all dark has no automatic exposure"
            )

    @classmethod
    def of_exposure(cls, exposure: float) -> Self:
        """Return the transform that multiplies luminances by a factor above 0."""
        if not 0 < exposure < np.inf:
            raise UsageError(f"expected an exposure above 0 and finite, got {exposure:g}")
        return cls(1 / exposure)

    @classmethod
    def automatic(
        cls,
        xyz: FloatArray,
        unclipped_per_cent: float = UNCLIPPED_PER_CENT,
        adapted_white: White | None = None,
    ) -> Self:
        """Return the transform that shows most pixels of X, Y, Z (…, 3) unclipped.

        Parameters
        ----------
        xyz
            X, Y, Z of a picture, or of several that are to have the same exposure, shape (…, 3).
        unclipped_per_cent
            Percentage, of the pixels that are not black, of those whose highest channel is at most
            full.
        adapted_white
            What is to look white, as in `Display`.

        Raises
        ------
        UsageError
            The percentage is not from 0 to 100, or all pixels are black.
        """
        if not 0 <= unclipped_per_cent <= 100:
            raise UsageError(f"expected a percentage from 0 to 100, got {unclipped_per_cent:g}")
        highest = _lifted(_adapted(xyz, adapted_white)).max(axis=-1)
        lit = highest[highest > 0]
        white_luminance = float(np.percentile(lit, unclipped_per_cent)) if lit.size else 0.0
        return cls(white_luminance, adapted_white)

    @property
    def exposure(self) -> float:
        """Factor by which luminances are multiplied, so that 1 is the screen's white."""
        return 1 / self.white_luminance

    @property
    def statement(self) -> str:
        """The transform in one line for people."""
        white = "D65"
        if self.adapted_white is not None:
            total = sum(self.adapted_white)
            x, y = (value / total for value in self.adapted_white[:2])
            white = f"x, y = {x:.4f}, {y:.4f} (by Bradford's transform)"
        return (
            f"sRGB (IEC 61966-2-1), {white} of luminance {rounded(self.white_luminance, 4)} is "
            "white; colours out of gamut are mixed with the grey of their luminance, brighter ones "
            "keep their hue"
        )

    def linear(self, xyz: FloatArray) -> FloatArray:
        """Return linear sRGB from 0 to 1 of X, Y, Z (…, 3)."""
        relative = _adapted(np.asarray(xyz, dtype=np.float64), self.adapted_white) * self.exposure
        lifted = _lifted(relative)
        over = np.maximum(lifted.max(axis=-1, keepdims=True), 1.0)
        fitted = lifted / over
        is_over = over[..., 0] > 1
        lab = oklab(fitted[is_over])
        lab += _whitened(over[is_over]) * (_WHITE_LAB - lab)
        fitted[is_over] = from_oklab(lab)
        return np.asarray(np.clip(fitted, 0.0, 1.0))

    def shown(self, xyz: FloatArray) -> Bytes:
        """Return the bytes of sRGB of X, Y, Z (…, 3)."""
        return srgb_bytes(self.linear(xyz))


def is_white(xyz: White) -> bool:
    """Return whether eyes adapt to a colour X, Y, Z, of any scale, as to a white.

    The responses that Bradford's transform adapts have to be above 0, which those to saturated
    colours are not.
    """
    return all(0 < value < np.inf for value in (*xyz, *(BRADFORD @ xyz).tolist()))


def _adapted(xyz: FloatArray, white: White | None) -> FloatArray:
    """Return X, Y, Z (…, 3) as they look where a white is adapted to the screen's."""
    if white is None:
        return xyz
    screen = BRADFORD @ np.linalg.inv(XYZ_TO_SRGB).sum(axis=1)
    gain = screen / (BRADFORD @ white) * white[1]
    return np.asarray(xyz @ (np.linalg.inv(BRADFORD) @ (gain[:, np.newaxis] * BRADFORD)).T)


def _lifted(xyz: FloatArray) -> FloatArray:
    """Return linear sRGB, colours with a negative channel mixed with their grey until it is 0."""
    linear = xyz @ XYZ_TO_SRGB.T
    grey = np.maximum(xyz[..., 1:2], 0.0)
    below = grey - linear.min(axis=-1, keepdims=True)
    kept = _ratio_up_to_one(grey, below)
    return np.asarray(grey + kept * (linear - grey))


def _whitened(over: FloatArray) -> FloatArray:
    """Return the part of white in a colour so many times brighter than the screen's."""
    return (over - 1) / (over - 1 + HALF_WHITE)


def _ratio_up_to_one(part: FloatArray, whole: FloatArray) -> FloatArray:
    """Return a ratio where the part is smaller, else 1; of whatever small numbers."""
    return np.divide(part, whole, out=np.ones_like(part), where=whole > part)
