"""A linear variable filter (LVF): a band whose wavelength depends on the place along a strip."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from labrig.optics.band import Bands
from labrig.optics.camera import CameraResponse
from labrig.optics.piecewise import FloatArray, hats, quadrature
from labrig.optics.spectrum import Spectrum
from labrig.optics.wavelength_map import WavelengthMap

#: Of an LVF of which nothing else is known (paper, section 4.1).
NOMINAL_FWHM_NM = 25.0


@dataclass(frozen=True, eq=False)
class Lvf:
    """A filter's bands at rising positions along the strip.

    Parameters
    ----------
    position
        Shape (p,), p ≥ 2, rising, in the unit of whoever measured them (pixels, mm).
    bands
        At those positions.
    sigma
        One standard deviation of each of the bands' figures, where it is known.
    remainder
        (p, n) what the bands' shape leaves of T_p(λ), straight lines between `remainder_nm` (n,);
        n may be 0.

    Raises
    ------
    ValueError
        Positions or centre wavelengths that do not rise or fall all the way.
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
        """T_p(λ) at (q,) wavelengths, shape (p, q), never negative."""
        transmission = self.bands.transmission(wavelength_nm)
        if len(self.remainder_nm):
            transmission = transmission + self.remainder @ hats(self.remainder_nm, wavelength_nm).T
        return np.maximum(transmission, 0.0)

    def at(self, position: ArrayLike) -> "Lvf":
        """The filter at other rising positions within its own, linear in between."""
        wanted = np.asarray(position, dtype=np.float64)
        if wanted.min() < self.position[0] or wanted.max() > self.position[-1]:
            raise ValueError(
                f"expected positions from {self.position[0]:g} to {self.position[-1]:g}, where the "
                f"filter is known, got {wanted.min():g} to {wanted.max():g}"
            )
        rows = [np.interp(wanted, self.position, column) for column in self.remainder.T]
        return Lvf(
            wanted,
            self.bands.between(self.position, wanted),
            None if self.sigma is None else self.sigma.between(self.position, wanted),
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
    """An LVF as its maker describes it: Gaussian bands, at the positions of some wavelengths."""
    position = np.sort(wavelengths.position(centre_nm))
    centre = wavelengths.wavelength_nm(position)
    same = np.ones_like(centre)
    return Lvf(position, Bands(centre, fwhm_nm * same, 0 * same, same, leakage * same))


def seen_through(lvf: Lvf, camera: CameraResponse, light: Spectrum) -> FloatArray:
    """What a camera sees of a light through the filter, ∫ T_p L S_c dλ, shape (p, channels)."""
    low, high = camera.wavelength_nm[0], camera.wavelength_nm[-1]
    nodes, weights = quadrature(low, high, camera.wavelength_nm, light.wavelength_nm)
    seen: FloatArray = lvf.transmission(nodes) @ (
        (weights * light.at(nodes))[:, np.newaxis] * camera.at(nodes)
    )
    return seen
