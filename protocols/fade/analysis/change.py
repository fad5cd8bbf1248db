"""Models of the lamp's transients: the fraction of its steady light, in a few parameters.

By Wien's law a body at the temperature T(t) has, of its light at T₀, the fraction

    ln fraction(λ, t) = −(hc/k) (1/T − 1/T₀) / λ = −u(t) (550 nm / λ)^p,   p = 1.

Parameters θ of all shapes end with p and with the lag of the shutter in s.
"""

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.protocols.fade.result import FittedShape, LampChange, SwitchedFrames
from labrig.results import Measured

#: Wavelength in nm at which u is minus the logarithm of the fraction.
REFERENCE_NM = 550.0
#: Unit of time of the polynomials in seconds.
SCALE_S = 0.3
#: Value of −ln fraction that counts as dark.
DARK = 60.0
#: ln of hc/(k · 550 nm · T₀) of a lamp of 3000 K, and its σ over lamps of 2700 K to 3400 K.
LN_KAPPA, LN_KAPPA_SIGMA = float(np.log(8.72)), 0.1
#: Prior σ of the ratio of radiation to conduction, ln r/(1 − r), nearly uninformative.
LOGIT_SIGMA = 1.5
#: Part of tungsten's specific heat at 3000 K that is missing when it is cold, and its σ (G. K.
#: White and M. L. Minges, Int. J. Thermophysics 18, 1997, 1269).
COLD_LOSS, COLD_LOSS_SIGMA = 0.42, 0.1
#: Temperature of the room over the filament's, and least difference to it.
ROOM, MIN_ABOVE_ROOM = 295 / 3000, 5e-3
#: Exponent of the temperature that tungsten's resistance is proportional to, and its σ: 1.20 from
#: 300 K to 3000 K (P. D. Desai et al., J. Phys. Chem. Ref. Data 13, 1984, 1069); leads and gas do
#: the rest.
RESISTANCE, RESISTANCE_SIGMA = 1.2, 0.1
#: Values of u between which the filament's cooling is integrated.
U_GRID: FloatArray = DARK * np.linspace(0.0, 1.0, 1001) ** 2
#: Values of −ln(1 − T) between which its heating is, from the room's temperature to where u < 1e-5,
#: and the least gain of heat by what is missing of T.
HEATING_GRID: FloatArray = np.linspace(-np.log(1 - ROOM), 14.0, 1001)
MIN_GAIN = 1e-3
#: Step of the derivatives as a fraction of σ.
STEP = 0.01
#: Places of p and of the lag among the parameters of all shapes.
EXPONENT, LAG = -2, -1


class Shape(Protocol):
    """Model u(t) of a turn-off or turn-on transient of the lamp."""

    @property
    def name(self) -> str:
        """Name of the model for people."""

    @property
    def rises(self) -> bool:
        """Whether the lamp is turned on."""

    @property
    def free(self) -> int:
        """Number of parameters besides p and the lag."""

    def start(self, level: float, slope: float) -> FloatArray:
        """Return initial parameters, shape (free,).

        They are those of ln u = level + slope t / `SCALE_S` of a rise, of u = −slope t / `SCALE_S`
        of a fade.
        """

    def u(self, parameters: FloatArray, t_s: FloatArray) -> FloatArray:
        """Return u at times ≥ 0 in seconds after the switch, shape (m,)."""

    def expected(self) -> tuple[FloatArray, FloatArray]:
        """Return prior values of the parameters and their σ, shape (free,) each.

        The σ of a parameter without prior is infinite.
        """


@dataclass(frozen=True)
class Cooling:
    """A filament that loses heat by radiation and conduction.

    c(T) dT/dt = −q/4 (r T⁵ + (1 − r) (T − Tₐ)/(1 − Tₐ)) from T₀ = 1, u = κ (1/T − 1). Radiation is
    proportional to T⁵, as tungsten's emissivity grows with T; the heat capacity is
    c = 1 − h (1 − T²). Parameters: ln κ, ln q, ln r/(1 − r), h.
    """

    rises: bool = False
    free: int = 4
    name: str = "filament"

    def start(self, level: float, slope: float) -> FloatArray:
        """Return initial parameters of equal radiation and conduction."""
        per_s = -slope / SCALE_S
        log_rate = np.log(4 * max(per_s, 0.1) / np.exp(LN_KAPPA))
        return np.array([LN_KAPPA, log_rate, 0.0, COLD_LOSS])

    def u(self, parameters: FloatArray, t_s: FloatArray) -> FloatArray:
        """Return u at times in seconds after the switch, shape (m,)."""
        kappa, rate = np.exp(parameters[:2])
        temperature = 1 / (1 + U_GRID / kappa)
        heat_capacity, lost = _capacity_and_loss(temperature, parameters)
        seconds_per_u = heat_capacity * temperature**2 / (kappa * lost * rate / 4)
        steps_s = np.diff(U_GRID) * (seconds_per_u[1:] + seconds_per_u[:-1]) / 2
        return np.interp(t_s, np.append(0.0, np.cumsum(steps_s)), U_GRID)

    def expected(self) -> tuple[FloatArray, FloatArray]:
        """Return prior values of the parameters of halogen lamps, and their σ."""
        return (
            np.array([LN_KAPPA, 0.0, 0.0, COLD_LOSS]),
            np.array([LN_KAPPA_SIGMA, np.inf, LOGIT_SIGMA, COLD_LOSS_SIGMA]),
        )


@dataclass(frozen=True)
class Heating:
    """The same filament at constant voltage, which a cold one draws more current at.

    c(T) dT/dt = q/4 (T^(−s) − r T⁵ − (1 − r) (T − Tₐ)/(1 − Tₐ)) from Tₐ, tungsten's resistance
    being proportional to T^s. Parameters: those of `Cooling`, then s.
    """

    rises: bool = True
    free: int = 5
    name: str = "filament"

    def start(self, level: float, slope: float) -> FloatArray:
        """Return initial parameters by which u falls to 1/e in the same time near its end."""
        # There dT/dt = −q/4 (s + 4 r + 1 + …) (T − 1), about 4 of them at equal losses.
        return np.array([LN_KAPPA, np.log(max(-slope / SCALE_S, 0.1)), 0.0, COLD_LOSS, RESISTANCE])

    def u(self, parameters: FloatArray, t_s: FloatArray) -> FloatArray:
        """Return u at times in seconds after the switch, shape (m,)."""
        kappa, rate = np.exp(parameters[:2])
        missing = np.exp(-HEATING_GRID)
        temperature = 1 - missing
        heat_capacity, lost = _capacity_and_loss(temperature, parameters)
        gained = np.maximum(temperature ** -parameters[4] - lost, MIN_GAIN * missing)
        seconds_per_step = heat_capacity * missing / (gained * rate / 4)
        steps_s = np.diff(HEATING_GRID) * (seconds_per_step[1:] + seconds_per_step[:-1]) / 2
        left = np.exp(-np.interp(t_s, np.append(0.0, np.cumsum(steps_s)), HEATING_GRID))
        u: FloatArray = np.minimum(kappa * left / (1 - left), DARK)
        return u

    def expected(self) -> tuple[FloatArray, FloatArray]:
        """Return prior values of the parameters of halogen lamps, and their σ."""
        mean, sigma = Cooling().expected()
        return np.append(mean, RESISTANCE), np.append(sigma, RESISTANCE_SIGMA)


def _capacity_and_loss(
    temperature: FloatArray, parameters: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the filament's heat capacity and loss of heat over those of the steady lamp."""
    radiated = 1 / (1 + np.exp(-parameters[2]))
    above_room = np.maximum(temperature - ROOM, MIN_ABOVE_ROOM) / (1 - ROOM)
    lost = radiated * temperature**5 + (1 - radiated) * above_room
    return 1 - parameters[3] * (1 - temperature**2), lost


@dataclass(frozen=True)
class Smooth:
    """Polynomial u(t) without a constant term, of a rise a polynomial ln u(t).

    Attributes
    ----------
    rises
        Whether the lamp is turned on.
    degree
        Degree of the polynomial.
    last_s
        Start of the last photograph in seconds after the switch; beyond it u is linear.
    """

    rises: bool
    degree: int
    last_s: float

    @property
    def free(self) -> int:
        """Number of coefficients."""
        return self.degree + (1 if self.rises else 0)

    @property
    def name(self) -> str:
        """Name of the model with its degree."""
        return f"polynomial of degree {self.degree}"

    def start(self, level: float, slope: float) -> FloatArray:
        """Return initial parameters of a straight line."""
        theta = np.zeros(self.free)
        if self.rises:
            theta[:2] = level, min(slope, -0.1)
        else:
            theta[0] = max(-slope, 0.1)
        return theta

    def u(self, parameters: FloatArray, t_s: FloatArray) -> FloatArray:
        """Return u at times in seconds after the switch, shape (m,)."""
        powers = np.arange(self.free) + (0 if self.rises else 1)
        end, x = self.last_s / SCALE_S, t_s / SCALE_S
        inner = np.minimum(x, end)[:, np.newaxis] ** powers @ parameters
        slope = float((powers * end ** np.maximum(powers - 1.0, 0.0)) @ parameters)
        value = inner + slope * np.maximum(x - end, 0.0)
        if self.rises:
            return np.minimum.accumulate(np.exp(np.clip(value, -DARK, np.log(DARK))))
        return np.clip(np.maximum.accumulate(value), 0.0, DARK)

    def expected(self) -> tuple[FloatArray, FloatArray]:
        """Return zeros and infinite σ: the coefficients have no prior."""
        return np.zeros(self.free), np.full(self.free, np.inf)


def fraction_of(shape: Shape, theta: FloatArray, nm: FloatArray, t_s: FloatArray) -> FloatArray:
    """Return the light at m times after the switch relative to the steady lamp's.

    The shape is (m, wavelengths).
    """
    u = shape.u(theta[:-2], np.maximum(t_s, 0.0))
    fraction: FloatArray = np.exp(-np.outer(u, (REFERENCE_NM / nm) ** theta[EXPONENT]))
    return fraction


@dataclass(frozen=True, eq=False)
class Fit:
    """Fit of one shape to the photographs.

    Attributes
    ----------
    shape, parameters, covariance
        Model, its parameters with p and the lag, and their covariance.
    jitter_s
        Scatter of the photographs' begins in seconds.
    chi2, dof
        χ² of the photographs and its degrees of freedom.
    log_determinant
        Logarithm of the determinant of the photographs' covariance.
    light_sigma_s
        σ of the photographs' light with all that scatters from one to the next, shape (n, S).
    """

    shape: Shape
    parameters: FloatArray
    covariance: FloatArray
    jitter_s: float
    chi2: float
    dof: int
    log_determinant: float
    light_sigma_s: FloatArray

    @property
    def reduced_chi2(self) -> float:
        """χ² per degree of freedom."""
        return self.chi2 / self.dof

    def in_bands(
        self, weights: FloatArray, nm: FloatArray, t_s: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return fraction and σ in bands by this shape alone, as `FittedChange.in_bands`."""
        fraction = fraction_of(self.shape, self.parameters, nm, t_s) @ weights.T
        slopes = []
        for number, step in enumerate(STEP * np.sqrt(np.diag(self.covariance))):
            moved = self.parameters.copy()
            moved[number] += step
            slopes.append((fraction_of(self.shape, moved, nm, t_s) @ weights.T - fraction) / step)
        slope = np.array(slopes)
        variance = np.einsum("ktb,kl,ltb->tb", slope, self.covariance, slope)
        return fraction, np.sqrt(np.maximum(variance, 0.0))


@dataclass(frozen=True, eq=False)
class FittedChange:
    """Fitted transient of the lamp.

    Attributes
    ----------
    fits
        Fits of the shapes that are compatible with the photographs.
    likely
        Probability of each shape (Burnham and Anderson, *Model selection and multimodel inference*,
        2002); sums to 1.
    """

    fits: tuple[Fit, ...]
    likely: FloatArray

    @property
    def rises(self) -> bool:
        """Whether the lamp is turned on."""
        return self.fits[0].shape.rises

    @property
    def lag(self) -> Measured:
        """Delay of the actual against the recorded opening of the shutter in seconds."""
        return self._mean(LAG, "s")

    def result(self, frames: SwitchedFrames) -> LampChange:
        """Return the transient as part of a result, with the frames that it was fitted to."""
        shapes = tuple(
            FittedShape(
                fit.shape.name, fit.parameters, fit.covariance, fit.jitter_s, fit.chi2, fit.dof,
                weight,
            )
            for fit, weight in zip(self.fits, self.likely.tolist(), strict=True)
        )  # fmt: skip
        best = self.fits[int(np.argmax(self.likely))]
        frames = replace(frames, light_sigma_s=best.light_sigma_s)
        return LampChange(frames, shapes, exponent=self._mean(EXPONENT), lag=self.lag)

    def in_bands(
        self, weights: FloatArray, nm: FloatArray, t_s: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the light relative to the steady lamp's and its σ, shape (times, bands) each.

        Parameters
        ----------
        weights
            Weights of the light at `nm` in every band, which sum to 1, shape (bands, wavelengths).
        nm
            Wavelengths in nm.
        t_s
            Times after the switch in seconds.
        """
        fractions, sigmas = zip(*(fit.in_bands(weights, nm, t_s) for fit in self.fits), strict=True)
        return self._average(np.array(fractions), np.array(sigmas))

    def _mean(self, parameter: int, unit: str = "") -> Measured:
        values = np.array([fit.parameters[parameter] for fit in self.fits])
        sigmas = [np.sqrt(fit.covariance[parameter, parameter]) for fit in self.fits]
        mean, sigma = self._average(values, np.array(sigmas))
        return Measured(float(mean), float(sigma), unit)

    def _average(self, values: FloatArray, sigmas: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Average over the fits, the first axis; σ includes their scatter."""
        mean = np.tensordot(self.likely, values, axes=1)
        variance = np.square(sigmas) + np.square(values - mean)
        return mean, np.sqrt(np.tensordot(self.likely, variance, axes=1))
