"""The linear system from a spectrum to the measured values, and its errors."""

from collections.abc import Iterator
from dataclasses import dataclass, field, fields

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import FloatArray
from labrig.optics import Bands, CameraResponse, Lvf, hat_functions, quadrature

#: Steps of the derivatives by an LVF's parameters, relative to their σ.
_STEP = 0.1


@dataclass(frozen=True)
class CurveError:
    """Error of a camera's curves as one standard deviation, smooth over wavelength.

    The defaults are the difference between two laboratories' curves of one Canon EOS 5D Mark II,
    and cover spectra from pictures taken with one and fitted with the other.

    Attributes
    ----------
    relative
        Error as a fraction of the curve itself.
    added
        Error as a fraction of the channel's peak: stray light, other infrared filters.
    correlation_nm
        Distance in nm at which errors are independent.
    """

    relative: float = 0.06
    added: float = 0.012
    correlation_nm: float = 40.0


@dataclass(frozen=True, eq=False)
class SpectralSystem:
    """Linear system value = (design + Σ_k z_k modes_k) · spectrum, z_k of unit variance.

    Attributes
    ----------
    knots_nm
        Rising knots in nm, shape (n,): the spectrum is piecewise linear between them, and zero
        outside.
    design
        Values per unit of the spectrum at every knot, shape (m, n).
    modes
        One standard deviation of the design in each independent error mode, shape (k, m, n).
    """

    knots_nm: FloatArray
    design: FloatArray
    modes: FloatArray = field(default_factory=lambda: np.empty((0, 0, 0)))

    def of(self, rows: NDArray[np.bool_]) -> "SpectralSystem":
        """Return the system of a selection of its values."""
        modes = self.modes[:, rows] if len(self.modes) else self.modes
        return SpectralSystem(self.knots_nm, self.design[rows], modes)

    def covariance(self, spectrum: FloatArray) -> FloatArray:
        """Return the covariance (m, m) of the values from the errors of the design alone."""
        deviations = self.modes @ spectrum if len(self.modes) else np.zeros((0, len(self.design)))
        result: FloatArray = deviations.T @ deviations
        return result


def system_through_lvf(
    lvf: Lvf, camera: CameraResponse, knots_nm: FloatArray, curve_error: CurveError | None = None
) -> SpectralSystem:
    """Return the system of a picture through a variable filter, values by (position, channel).

    Parameters
    ----------
    lvf
        Filter at the positions that were read; its σ, where known, adds modes.
    camera
        Camera with its curves on their own wavelengths.
    knots_nm
        Knots of the spectrum in nm, shape (n,).
    curve_error
        Error of the camera's curves; None takes them for exact.
    """
    nodes, weights = quadrature(
        float(knots_nm[0]), float(knots_nm[-1]), camera.wavelength_nm, knots_nm
    )
    onto_knots = weights[:, np.newaxis] * hat_functions(knots_nm, nodes)
    sensitivity = camera.at(nodes)

    def design(transmission: FloatArray, curves: FloatArray) -> FloatArray:
        """Return the design matrix, shape (positions · channels, n)."""
        values = np.stack([(transmission * curve) @ onto_knots for curve in curves.T], axis=1)
        return values.reshape(-1, len(knots_nm))

    transmission = lvf.transmission(nodes)
    exact = design(transmission, sensitivity)
    modes = [design(transmission, error) for error in camera_modes(camera, nodes, curve_error)]
    for position, change in _filter_changes(lvf, nodes):
        mode = np.zeros((len(transmission), sensitivity.shape[1], len(knots_nm)))
        mode[position] = (change[:, np.newaxis] * sensitivity).T @ onto_knots
        modes.append(mode.reshape(exact.shape))
    stacked = np.array(modes) if modes else np.empty((0, 0, 0))
    return SpectralSystem(knots_nm, exact, stacked)


def curve_modes(
    error: CurveError | None, nodes: FloatArray, sensitivity: FloatArray, peaks: FloatArray
) -> list[FloatArray]:
    """Return changes of the curves (q, channels), each one σ of one channel about one wavelength.

    Parameters
    ----------
    error
        Error of the curves; None for none.
    nodes, sensitivity
        Wavelengths in nm (q,) and curves at them (q, channels).
    peaks
        Maximum of each curve, shape (channels,).
    """
    if error is None:
        return []
    smooth = smooth_modes(nodes, error.correlation_nm)
    modes = []
    for channel, peak in enumerate(peaks):
        for fraction, shape in (
            (error.relative, sensitivity[:, channel]),
            (error.added * peak, 1.0),
        ):
            for mode in smooth if fraction > 0 else ():
                change = np.zeros_like(sensitivity)
                change[:, channel] = fraction * mode * shape
                modes.append(change)
    return modes


def camera_modes(
    camera: CameraResponse, nodes: FloatArray, unknown: CurveError | None
) -> list[FloatArray]:
    """Return changes of a camera's curves (q, channels), of one σ about one wavelength each.

    Curves that were measured with their σ have that one; others err as published curves do.

    Parameters
    ----------
    camera
        Curves of the camera.
    nodes
        Wavelengths in nm, shape (q,).
    unknown
        Error of curves without σ, and distance at which errors are independent; None for none.
    """
    if unknown is None or camera.sigma is None:
        return curve_modes(unknown, nodes, camera.at(nodes), camera.sensitivity.max(axis=0))
    modes = []
    for channel, sigma in enumerate(camera.sigma.T):
        own = np.interp(nodes, camera.wavelength_nm, sigma, left=0.0, right=0.0)
        for mode in smooth_modes(nodes, unknown.correlation_nm):
            change = np.zeros((len(nodes), len(camera.channels)))
            change[:, channel] = own * mode
            modes.append(change)
    return modes


def smooth_modes(nodes: FloatArray, distance_nm: float) -> FloatArray:
    """Return (k, q) functions whose sum with unit normal weights is smooth and of unit variance."""
    knots = np.arange(nodes[0] - distance_nm, nodes[-1] + 2 * distance_nm, distance_nm)
    fraction = np.clip(hat_functions(knots, nodes), 0.0, 1.0)
    modes: FloatArray = np.sin(np.pi / 2 * fraction).T
    return modes[modes.any(axis=1)]


def _filter_changes(lvf: Lvf, nodes: FloatArray) -> Iterator[tuple[int, FloatArray]]:
    """Yield changes of the transmission (q,) at one position, each by one of its parameters."""
    if lvf.sigma is None:
        return
    for name in (f.name for f in fields(Bands)):
        step = _STEP * getattr(lvf.sigma, name)
        change = (
            lvf.changed_bands(name, _STEP).transmission(nodes) - lvf.bands.transmission(nodes)
        ) / _STEP
        for position in np.flatnonzero(step > 0).tolist():
            yield position, change[position]
