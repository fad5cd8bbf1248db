"""What a spectrum adds to every value that was measured: the linear system, and its own errors."""

from collections.abc import Iterator
from dataclasses import dataclass, field, fields, replace

import numpy as np
from numpy.typing import NDArray

from labrig.optics import Bands, CameraResponse, Lvf, hats, quadrature

FloatArray = NDArray[np.float64]

#: Steps of the derivatives by an LVF's figures, relative to their σ.
_STEP = 0.1


@dataclass(frozen=True)
class CurveError:
    """How well a camera's curves are known; one standard deviation, smooth over wavelength.

    The defaults are what two laboratories' curves of one Canon EOS 5D Mark II differ by, and cover
    spectra from pictures taken with one and fitted with the other.

    Attributes
    ----------
    relative
        Fraction of the curve itself.
    added
        Fraction of the channel's peak, added to the curve: stray light, other infrared filters.
    correlation_nm
        Errors this far apart are independent.
    """

    relative: float = 0.06
    added: float = 0.012
    correlation_nm: float = 40.0


@dataclass(frozen=True, eq=False)
class SpectralSystem:
    """value = (design + Σ_k z_k modes_k) · spectrum, z_k independent and of unit variance.

    Attributes
    ----------
    knots_nm
        (n,) rising: the spectrum is straight lines between its values there, and zero outside.
    design
        (m, n) values per unit of the spectrum at every knot.
    modes
        (k, m, n) one standard deviation of the design in each independent way it may be wrong.
    """

    knots_nm: FloatArray
    design: FloatArray
    modes: FloatArray = field(default_factory=lambda: np.empty((0, 0, 0)))

    def of(self, rows: NDArray[np.bool_]) -> "SpectralSystem":
        """The system of some of its values."""
        modes = self.modes[:, rows] if len(self.modes) else self.modes
        return SpectralSystem(self.knots_nm, self.design[rows], modes)

    def covariance(self, spectrum: FloatArray) -> FloatArray:
        """(m, m) of the values, by the errors of the design alone."""
        wrong = self.modes @ spectrum if len(self.modes) else np.zeros((0, len(self.design)))
        result: FloatArray = wrong.T @ wrong
        return result


def system_through_lvf(
    lvf: Lvf, camera: CameraResponse, knots_nm: FloatArray, curve_error: CurveError | None = None
) -> SpectralSystem:
    """The system of a picture through a variable filter, values in the order (position, channel).

    Parameters
    ----------
    lvf
        At the positions that were read; where its σ is known it goes into the modes.
    camera
        Its curves on their own wavelengths.
    knots_nm
        (n,) of the spectrum wanted.
    curve_error
        Of the camera's curves; None takes them for exact.
    """
    nodes, weights = quadrature(
        float(knots_nm[0]), float(knots_nm[-1]), camera.wavelength_nm, knots_nm
    )
    hat_functions = weights[:, np.newaxis] * hats(knots_nm, nodes)
    sensitivity = camera.at(nodes)

    def design(transmission: FloatArray, curves: FloatArray) -> FloatArray:
        """(positions · channels, n)."""
        values = np.stack([(transmission * curve) @ hat_functions for curve in curves.T], axis=1)
        return values.reshape(-1, len(knots_nm))

    transmission = lvf.transmission(nodes)
    exact = design(transmission, sensitivity)
    modes = [
        design(transmission, error)
        for error in curve_modes(curve_error, nodes, sensitivity, camera.sensitivity.max(axis=0))
    ]
    for position, change in _filter_changes(lvf, nodes):
        mode = np.zeros((len(transmission), sensitivity.shape[1], len(knots_nm)))
        mode[position] = (change[:, np.newaxis] * sensitivity).T @ hat_functions
        modes.append(mode.reshape(exact.shape))
    stacked = np.array(modes) if modes else np.empty((0, 0, 0))
    return SpectralSystem(knots_nm, exact, stacked)


def curve_modes(
    error: CurveError | None, nodes: FloatArray, sensitivity: FloatArray, peaks: FloatArray
) -> list[FloatArray]:
    """Changes of the curves (q, channels), each one σ of one channel about one wavelength.

    Parameters
    ----------
    nodes, sensitivity
        (q,) wavelengths and (q, channels) the curves there.
    peaks
        (channels,) highest of each curve.
    """
    if error is None:
        return []
    smooth = _smooth_modes(nodes, error.correlation_nm)
    modes = []
    for channel, peak in enumerate(peaks):
        for fraction, of in ((error.relative, sensitivity[:, channel]), (error.added * peak, 1.0)):
            for mode in smooth if fraction > 0 else ():
                change = np.zeros_like(sensitivity)
                change[:, channel] = fraction * mode * of
                modes.append(change)
    return modes


def _smooth_modes(nodes: FloatArray, distance_nm: float) -> FloatArray:
    """(k, q) functions whose sum with unit normal weights is smooth and of unit variance."""
    knots = np.arange(nodes[0] - distance_nm, nodes[-1] + 2 * distance_nm, distance_nm)
    fraction = np.clip(hats(knots, nodes), 0.0, 1.0)
    modes: FloatArray = np.sin(np.pi / 2 * fraction).T
    return modes[modes.any(axis=1)]


def _filter_changes(lvf: Lvf, nodes: FloatArray) -> Iterator[tuple[int, FloatArray]]:
    """Changes of the transmission (q,) at one position, each by one of its figures."""
    if lvf.sigma is None:
        return
    for name in (f.name for f in fields(Bands)):
        step = _STEP * getattr(lvf.sigma, name)
        moved = replace(lvf.bands, **{name: getattr(lvf.bands, name) + step})
        change = (moved.transmission(nodes) - lvf.bands.transmission(nodes)) / _STEP
        for position in np.flatnonzero(step > 0).tolist():
            yield position, change[position]
