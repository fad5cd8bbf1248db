"""What several methods say of the same sample, and the mixture that stands for its matrix."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.material import ReradiationMixture

#: All LEDs together, the thesis's method of one LED by itself.
EstimateMethod = Literal["joint", "per-led"]
#: The same, and a spectrometer that reads each column of the matrix.
MeasuringMethod = Literal["joint", "per-led", "direct"]


@dataclass(frozen=True, eq=False)
class ReradiatedSpectrum:
    """Re-radiated light, as part of the light that falls in.

    Attributes
    ----------
    output_nm
        Middles of the bands of the returning light in nm, shape (o,).
    value, sigma
        Re-radiation in 1/nm of output and its σ, shape (o,); NaN where it is not measured, and no σ
        where the method has none.
    """

    output_nm: FloatArray
    value: FloatArray
    sigma: FloatArray | None


@dataclass(frozen=True, eq=False)
class ReradiationUnderLight:
    """What a sample re-radiates under one narrow-band light, by each method.

    Attributes
    ----------
    light, peak_nm
        Name of the light, and its peak in nm.
    joint, per_led
        Re-radiation by all LEDs together, and by one LED by itself.
    direct
        Re-radiation as a spectrometer read it; None without a direct measurement.
    """

    light: str
    peak_nm: float
    joint: ReradiatedSpectrum
    per_led: ReradiatedSpectrum
    direct: ReradiatedSpectrum | None


@dataclass(frozen=True)
class MethodDifference:
    """Colour difference between the matrices of two methods under a light.

    Attributes
    ----------
    first, second
        The methods.
    light
        Name of the light; its perfect white is the white.
    delta_e
        ΔE2000. What a direct measurement does not reach is taken from the other method.
    """

    first: MeasuringMethod
    second: MeasuringMethod
    light: str
    delta_e: float


@dataclass(frozen=True, eq=False)
class MixtureOfMatrix:
    """Mixture of normal densities that stands for the measured part of a matrix.

    Attributes
    ----------
    scale
        Integral of the re-radiation over input and output in nm.
    weights, mean_nm, covariance_nm2
        Weights, means [input, output] in nm and covariances in nm², shapes (K,), (K, 2), (K, 2, 2).
    measured_nm
        Ends in nm of the incident light to which it was fitted. What it says beyond is the tail of
        its densities, and was not measured.
    threshold
        Least value per band that counted as re-radiation.
    kept_entries, entries
        Number of entries above the threshold, and of all measured ones.
    masked_mse
        Mean squared error per band.
    band_nm
        Width of the output bands in nm.
    """

    scale: float
    weights: FloatArray
    mean_nm: FloatArray
    covariance_nm2: FloatArray
    measured_nm: tuple[float, float]
    threshold: float
    kept_entries: int
    entries: int
    masked_mse: float
    band_nm: float

    @property
    def mixture(self) -> ReradiationMixture:
        """The densities, to draw from or to evaluate."""
        return ReradiationMixture(self.scale, self.weights, self.mean_nm, self.covariance_nm2)

    def to_dict(self) -> dict[str, Any]:
        """Return the content of `mixture.json`, with the keys of `labrig fit mixture`."""
        return {
            "scale": self.scale * self.band_nm,
            "band_nm": self.band_nm,
            "unit": "1/nm",
            "components": [
                {
                    "weight": float(weight),
                    "mean": np.asarray(mean).tolist(),
                    "covariance": np.asarray(covariance).tolist(),
                }
                for weight, mean, covariance in zip(
                    self.weights, self.mean_nm, self.covariance_nm2, strict=True
                )
            ],
            "scaling": "integral",
            "measured_input_nm": list(self.measured_nm),
            "threshold": self.threshold,
            "kept_entries": self.kept_entries,
            "entries": self.entries,
            "masked_mse": self.masked_mse,
        }
