"""A linear variable filter (LVF): its pass band depends on the position along a strip."""

import math
from dataclasses import dataclass, field, fields, replace
from itertools import pairwise
from typing import Annotated, Self

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field, model_validator

from labrig.foundation.arrays import FloatArray
from labrig.foundation.models import FrozenModel, UnitFraction
from labrig.foundation.region import Region, region_pixels
from labrig.optics.camera import CameraResponse
from labrig.optics.piecewise import hat_functions, quadrature
from labrig.optics.spectrum import Spectrum

#: Asymmetry below which the limit, a Gaussian, is equally exact.
_GAUSSIAN = 1e-9
_LN2 = float(np.log(2.0))


def peak_shape(
    distance_nm: FloatArray, fwhm_nm: ArrayLike, skew: ArrayLike, order: ArrayLike = 2.0
) -> FloatArray:
    """Return a skewed Gaussian, or a peak with steeper or flatter sides, of height 1.

    The shape is exp(−ln 2 · yⁿ), y the absolute value of ln(1 + 2 a x / w) / a, with a = `skew`,
    n = `order` and w such that the full width at half maximum is `fwhm_nm`. a > 0 extends the tail
    to long wavelengths, a = 0 with n = 2 is a Gaussian.

    Parameters
    ----------
    distance_nm
        Wavelength minus that of the peak, in nm.
    fwhm_nm
        Full width at half maximum in nm, broadcast against `distance_nm`.
    skew
        Dimensionless asymmetry a, broadcast against `distance_nm`.
    order
        Exponent n, broadcast against `distance_nm`; above 2 it is flatter on top, with steeper
        sides.

    Returns
    -------
    ndarray
        Values from 0 to 1 in the broadcast shape.

    References
    ----------
    R. D. B. Fraser, E. Suzuki, *Resolution of overlapping absorption bands by least squares
    procedures*, Anal. Chem. 38 (1966).

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.optics import peak_shape
    >>> distance_nm = np.array([-25.0, -12.5, 0.0, 12.5, 25.0])
    >>> peak_shape(distance_nm, 25.0, 0.0).round(4).tolist()
    [0.0625, 0.5, 1.0, 0.5, 0.0625]
    >>> peak_shape(distance_nm, 25.0, 0.3).round(3).tolist()
    [0.001, 0.362, 1.0, 0.58, 0.175]
    """
    a = np.asarray(skew, dtype=np.float64)
    skewed = np.abs(a) > _GAUSSIAN
    a = np.where(skewed, a, 1.0)
    width = np.asarray(fwhm_nm, dtype=np.float64) * np.where(skewed, a / np.sinh(a), 1.0)
    x = 2 * distance_nm / width
    inside = 1 + a * x > 0
    stretched = np.where(skewed, np.log1p(np.where(inside, a * x, 0.0)) / a, x)
    shape: FloatArray = np.where(~skewed | inside, np.exp(-_LN2 * np.abs(stretched) ** order), 0.0)
    return shape


@dataclass(frozen=True, eq=False)
class Bands:
    """Pass bands of a filter at some positions, every array of shape (positions,).

    Attributes
    ----------
    centre_nm
        Wavelength of highest transmission in nm.
    fwhm_nm
        Full width at half maximum above the leakage in nm.
    skew
        Dimensionless asymmetry, as defined in `peak_shape`.
    peak
        Transmission at the centre, above the leakage.
    leakage
        Transmission outside of the band.
    """

    centre_nm: FloatArray
    fwhm_nm: FloatArray
    skew: FloatArray
    peak: FloatArray
    leakage: FloatArray

    def transmission(self, wavelength_nm: FloatArray) -> FloatArray:
        """Return T_p(λ) at (q,) wavelengths in nm, shape (positions, q)."""
        distance = wavelength_nm - self.centre_nm[:, np.newaxis]
        shape = peak_shape(distance, self.fwhm_nm[:, np.newaxis], self.skew[:, np.newaxis])
        return self.leakage[:, np.newaxis] + self.peak[:, np.newaxis] * shape

    def between(self, position: FloatArray, new_position: FloatArray) -> Self:
        """Return the bands at other positions, each parameter interpolated along `position`."""
        return type(self)(
            *(
                np.interp(new_position, position, getattr(self, field.name))
                for field in fields(self)
            )
        )


#: Number of points at which a map is validated, and between which it is inverted.
_SAMPLES = 2049


@dataclass(frozen=True, eq=False)
class WavelengthMap:
    """Centre wavelength λ(u) = Σ_k c_k ((u − u_0)/s)^k along a strip.

    Parameters
    ----------
    coefficients
        Coefficients c in nm, shape (k,), the constant first.
    span
        First and last position at which the map holds: u_0 is their middle, s half their distance.
    covariance
        Covariance of the coefficients in nm², shape (k, k).

    Raises
    ------
    ValueError
        The map is not monotone within `span`.
    """

    coefficients: FloatArray
    span: tuple[float, float]
    covariance: FloatArray | None = None

    def __post_init__(self) -> None:
        steps = np.diff(self.wavelength_nm(np.linspace(*self.span, _SAMPLES)))
        if not ((steps > 0).all() or (steps < 0).all()):
            raise ValueError(
                "the wavelength does not rise or fall all the way along the strip; check which "
                "lines were taken for which"
            )

    @property
    def rising(self) -> bool:
        """Whether the wavelength increases with the position."""
        first, last = self.wavelength_nm(np.array(self.span))
        return bool(last > first)

    def wavelength_nm(self, position: ArrayLike) -> FloatArray:
        """Return the centre wavelengths in nm at some positions."""
        return self._powers(position) @ self.coefficients

    def sigma_nm(self, position: ArrayLike) -> FloatArray:
        """Return one standard deviation of `wavelength_nm`, 0 without a covariance."""
        powers = self._powers(position)
        if self.covariance is None:
            return np.zeros(len(powers))
        variance: FloatArray = np.einsum("pk,kl,pl->p", powers, self.covariance, powers)
        return np.sqrt(np.maximum(variance, 0.0))

    def position(self, wavelength_nm: ArrayLike) -> FloatArray:
        """Return the positions of some wavelengths, by Newton's method from a table.

        Raises
        ------
        ValueError
            A wavelength is not on the strip.
        """
        target_nm = np.atleast_1d(np.asarray(wavelength_nm, dtype=np.float64))
        positions = np.linspace(*self.span, _SAMPLES)
        table_nm = self.wavelength_nm(positions)
        if target_nm.min() < table_nm.min() or target_nm.max() > table_nm.max():
            raise ValueError(
                f"expected wavelengths from {table_nm.min():.1f} to {table_nm.max():.1f} nm, which "
                f"the strip shows, got {target_nm.min():.1f} to {target_nm.max():.1f}"
            )
        order = slice(None) if self.rising else slice(None, None, -1)
        position = np.interp(target_nm, table_nm[order], positions[order])
        for _ in range(2):
            position = position - (self.wavelength_nm(position) - target_nm) / self._slope(position)
        return position

    def _scaled(self, position: ArrayLike) -> FloatArray:
        low, high = self.span
        u = np.atleast_1d(np.asarray(position, dtype=np.float64))
        return (u - (low + high) / 2) / ((high - low) / 2)

    def _powers(self, position: ArrayLike) -> FloatArray:
        return np.vander(self._scaled(position), len(self.coefficients), increasing=True)

    def _slope(self, position: FloatArray) -> FloatArray:
        low, high = self.span
        orders = np.arange(1, len(self.coefficients))
        lower = self._powers(position)[:, :-1]
        slope: FloatArray = lower @ (orders * self.coefficients[1:]) / ((high - low) / 2)
        return slope


#: Wavelengths in nm of the remainder of a filter that has none of its own.
_REMAINDER_NM: FloatArray = np.arange(300.0, 901.0, 5.0)

#: Full width at half maximum of an LVF without a calibration, in nm (paper, section 4.1).
NOMINAL_FWHM_NM = 25.0


@dataclass(frozen=True, eq=False)
class Lvf:
    """Pass bands of a filter at rising positions along the strip.

    Parameters
    ----------
    position
        Rising positions, shape (p,), p ≥ 2, in any unit (pixels, mm).
    bands
        Pass bands at these positions.
    sigma
        One standard deviation of each of the bands' parameters, where it is known: of the width
        at the same ∫ T dλ, of the peak at the same width.
    remainder_nm
        Wavelengths of `remainder` in nm, shape (n,); n may be 0.
    remainder
        Deviation of T_p(λ) from the bands' shape, shape (p, n), piecewise linear between
        `remainder_nm`.

    Raises
    ------
    ValueError
        Positions or centre wavelengths are not monotone.
    """

    position: FloatArray
    bands: Bands
    sigma: Bands | None = None
    remainder_nm: FloatArray = field(default_factory=lambda: np.empty(0))
    remainder: FloatArray = field(default_factory=lambda: np.empty((0, 0)))

    def __post_init__(self) -> None:
        if len(self.position) < 2 or (np.diff(self.position) <= 0).any():
            raise ValueError("expected two or more rising positions along the filter")
        steps = np.diff(self.bands.centre_nm)
        if not ((steps > 0).all() or (steps < 0).all()):
            raise ValueError("expected centre wavelengths that rise or fall along the filter")

    def transmission(self, wavelength_nm: FloatArray) -> FloatArray:
        """Return T_p(λ) ≥ 0 at (q,) wavelengths in nm, shape (p, q)."""
        transmission = self.bands.transmission(wavelength_nm)
        if len(self.remainder_nm):
            transmission = (
                transmission + self.remainder @ hat_functions(self.remainder_nm, wavelength_nm).T
            )
        return np.maximum(transmission, 0.0)

    def changed_bands(self, parameter: str, sigmas: float) -> Bands:
        """Return the bands with one of their parameters changed by some of its σ.

        What passes in all is known better than its distribution: a wider band is less high.

        Parameters
        ----------
        parameter
            Name of the parameter, a field of `Bands`.
        sigmas
            Number of its standard deviations.

        Raises
        ------
        ValueError
            The filter has no σ.
        """
        if self.sigma is None:
            raise ValueError("expected a filter with its σ, got one without")
        value = getattr(self.bands, parameter) + sigmas * getattr(self.sigma, parameter)
        changed = replace(self.bands, **{parameter: value})
        return replace(changed, peak=changed.peak * self.bands.fwhm_nm / changed.fwhm_nm)

    def twice(self) -> "Lvf":
        """Return the filter that light passes twice in the same place, of transmission T².

        The square of the bands' shape is one of the same kind; what it leaves is the remainder.
        """
        bands, root = self.bands, np.sqrt(2.0)
        skew = bands.skew / root
        width = np.divide(bands.skew, np.sinh(bands.skew), where=np.abs(bands.skew) > _GAUSSIAN,
                          out=np.ones_like(bands.skew))  # fmt: skip
        narrower = np.divide(np.sinh(skew), skew, where=np.abs(skew) > _GAUSSIAN,
                             out=np.ones_like(skew))  # fmt: skip
        squared = Bands(
            bands.centre_nm, bands.fwhm_nm * width / root * narrower, skew,
            bands.peak**2, bands.leakage**2,
        )  # fmt: skip
        grid = self.remainder_nm if len(self.remainder_nm) else _REMAINDER_NM
        remainder = self.transmission(grid) ** 2 - squared.transmission(grid)
        sigma = self.sigma
        if sigma is not None:
            sigma = Bands(
                sigma.centre_nm, sigma.fwhm_nm / root, sigma.skew / root,
                2 * bands.peak * sigma.peak, 2 * bands.leakage * sigma.leakage,
            )  # fmt: skip
        return Lvf(self.position, squared, sigma, grid, remainder)

    def at(self, position: ArrayLike) -> "Lvf":
        """Return the filter at other rising positions within its own, linearly interpolated."""
        new_position = np.asarray(position, dtype=np.float64)
        if new_position.min() < self.position[0] or new_position.max() > self.position[-1]:
            raise ValueError(
                f"expected positions from {self.position[0]:g} to {self.position[-1]:g}, where the "
                f"filter is known, got {new_position.min():g} to {new_position.max():g}"
            )
        rows = [np.interp(new_position, self.position, column) for column in self.remainder.T]
        return Lvf(
            new_position,
            self.bands.between(self.position, new_position),
            None if self.sigma is None else self.sigma.between(self.position, new_position),
            self.remainder_nm,
            np.array(rows).T if rows else np.empty((0, 0)),
        )


def nominal_lvf(
    wavelengths: WavelengthMap,
    centre_nm: ArrayLike,
    *,
    fwhm_nm: float = NOMINAL_FWHM_NM,
    leakage: float = 0.0,
) -> Lvf:
    """Return a filter as its maker describes it, with equal Gaussian bands.

    Parameters
    ----------
    wavelengths
        Centre wavelength along the strip.
    centre_nm
        Centre wavelengths of the bands in nm, shape (p,), in any order.
    fwhm_nm
        Full width at half maximum of every band in nm.
    leakage
        Transmission outside of the bands, as a fraction of the peak's.

    Returns
    -------
    Lvf
        The filter at the p positions of these wavelengths, with peak transmission 1.

    Raises
    ------
    ValueError
        A wavelength is not on the strip.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.optics import WavelengthMap, nominal_lvf
    >>> wavelengths = WavelengthMap(np.array([550.0, 200.0]), span=(0.0, 1.0))
    >>> lvf = nominal_lvf(wavelengths, [400.0, 500.0, 600.0], fwhm_nm=20.0)
    >>> lvf.position.round(6).tolist()
    [0.125, 0.375, 0.625]
    >>> lvf.transmission(np.array([500.0, 510.0])).round(3).tolist()
    [[0.0, 0.0], [1.0, 0.5], [0.0, 0.0]]
    """
    position = np.sort(wavelengths.position(centre_nm))
    centre = wavelengths.wavelength_nm(position)
    ones = np.ones_like(centre)
    return Lvf(position, Bands(centre, fwhm_nm * ones, 0 * ones, ones, leakage * ones))


def signal_through(lvf: Lvf, camera: CameraResponse, light: Spectrum) -> FloatArray:
    """Return the signal of a light in a camera behind the filter, ∫ T_p L S_c dλ.

    Parameters
    ----------
    lvf
        The filter with its transmission T_p at p positions.
    camera
        The camera with the sensitivities S_c.
    light
        Spectrum L of the light, per nm.

    Returns
    -------
    ndarray
        Signal at each position in each channel, shape (p, channels), in the unit of the light times
        nm.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.optics import Spectrum, WavelengthMap, nominal_lvf, read_camera, signal_through
    >>> wavelengths = WavelengthMap(np.array([550.0, 200.0]), span=(0.0, 1.0))
    >>> lvf = nominal_lvf(wavelengths, [450.0, 530.0, 610.0])
    >>> white = Spectrum("equal energy", np.array([380.0, 780.0]), np.ones(2))
    >>> signal_through(lvf, read_camera("canon_eos_5d_mark_ii"), white).round(1).tolist()
    [[0.2, 2.9, 22.3], [3.8, 25.9, 3.5], [12.5, 4.4, 0.2]]
    """
    low, high = camera.wavelength_nm[0], camera.wavelength_nm[-1]
    nodes, weights = quadrature(low, high, camera.wavelength_nm, light.wavelength_nm)
    signal: FloatArray = lvf.transmission(nodes) @ (
        (weights * light.at(nodes))[:, np.newaxis] * camera.at(nodes)
    )
    return signal


#: Number of positions along a strip at which pictures are read (paper, section 4.2).
SLICES = 31


class Strip(FrozenModel):
    """Position of the filter in the frame, in fractions of the frame's width and height.

    Attributes
    ----------
    left, right
        Coordinates (x, y) of the two ends of the centre line.
    height
        Height of the strip without its blurred edges.
    rising
        Whether the wavelength rises from left to right.
    """

    left: tuple[UnitFraction, UnitFraction]
    right: tuple[UnitFraction, UnitFraction]
    height: Annotated[float, Field(gt=0, le=1)]
    rising: bool

    @model_validator(mode="after")
    def _inside_the_frame(self) -> Self:
        if self.right[0] <= self.left[0]:
            raise ValueError(
                f"expected 'right' to the right of 'left', got x = {self.right[0]:g} and "
                f"{self.left[0]:g}"
            )
        middles = (self.left[1], self.right[1])
        if min(middles) < self.height / 2 or max(middles) > 1 - self.height / 2:
            raise ValueError("expected a strip inside of the frame, it leaves it at a long side")
        return self

    def slices(self, count: int = SLICES) -> dict[str, Region]:
        """Divide the strip into upright regions from the blue end to the red end.

        Returns
        -------
        dict
            Regions by the names `p00`, `p01`, …; slice k reaches from position k/count to (k +
            1)/count.
        """
        ends = np.linspace(self.left[0], self.right[0], count + 1)
        middles = np.linspace(self.left[1], self.right[1], 2 * count + 1)[1::2]
        regions = [
            (float(start), max(float(y) - self.height / 2, 0.0), float(end - start), self.height)
            for (start, end), y in zip(pairwise(ends), middles, strict=True)
        ]
        ordered = regions if self.rising else regions[::-1]
        return {f"p{number:02d}": region for number, region in enumerate(ordered)}

    def positions(self, width: int, height: int, count: int = SLICES) -> tuple[float, ...]:
        """Return the middle of each slice in whole pixels, from 0 (blue end) to 1 (red end).

        A frame of `width` × `height` pixels resolves no other positions.
        """
        fractions = []
        for region in self.slices(count).values():
            x, _, region_width, _ = region_pixels(region, width, height)
            fraction = ((x + region_width / 2) / width - self.left[0]) / (
                self.right[0] - self.left[0]
            )
            fractions.append(fraction if self.rising else 1 - fraction)
        return tuple(fractions)

    def tilt_degrees(self, width: int, height: int) -> float:
        """Return the tilt of the strip in a frame in degrees, > 0 if it falls to the right."""
        across = (self.right[0] - self.left[0]) * width
        down = (self.right[1] - self.left[1]) * height
        return math.degrees(math.atan2(down, across))
