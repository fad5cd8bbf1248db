"""How well a smooth spectrum with lines explains some values, whatever its brightness and shape.

Given the weight of the smoothness prior and the lines' wavelengths and shapes, the smooth spectrum
and the lines' powers are normal: they are integrated out exactly, and what remains is the evidence
p(values | weight, lines). That they are not negative is taken into account as the probability of
each power, and of the smooth spectrum at places between which it hardly bends, taken by itself.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import LinAlgError, lapack, solve_triangular
from scipy.special import log_ndtr

from labrig.fit.least_squares import FloatArray
from labrig.fit.spectrum.feature import FINER, Feature
from labrig.fit.spectrum.line import FWHM_OVER_SIGMA

#: Features with which the first is sought: their distance in knots, and their widths.
TRIED, TRIED_FWHM_NM = 0.5, (3.0, 8.0, 14.0, 22.0, 32.0)
#: Least significance, in σ of the values, of a line with all the light.
SEEN_SIGMA = 30.0
#: Distance in knots of the places at which the smooth spectrum must not be negative, and how much
#: it may be, for a spectrum of about 1.
PLACES, TOLERATED = 4, 0.01


@dataclass(frozen=True, eq=False)
class Evidence:
    """Log evidence of weights and features given values, up to a constant.

    Attributes
    ----------
    target
        Whitened values, shape (m,).
    fine_design, fine_nm
        Their whitened design (m, q) on the knots of lines (q,).
    smooth, along
        Whitened design of the smooth spectrum in units of its posterior for every weight, shape
        (weights, n, m), and its product with the values, shape (weights, n).
    log_smooth
        Log evidence of every weight without features, shape (weights,).
    at_places, variance_at_places
        Smooth spectrum at p places by the values, shape (weights, p, m), and its variance, shape
        (weights, p).
    power
        Prior σ of a feature's power: all the light.
    """

    target: FloatArray
    fine_design: FloatArray
    fine_nm: FloatArray
    smooth: FloatArray
    along: FloatArray
    log_smooth: FloatArray
    at_places: FloatArray
    variance_at_places: FloatArray
    power: float

    @property
    def margin_nm(self) -> float:
        """Distance of the knots of the smooth spectrum."""
        return float(self.fine_nm[1] - self.fine_nm[0]) / FINER

    @cached_property
    def range_nm(self) -> tuple[float, float]:
        """Least and largest wavelength of a feature: a knot within what the values see."""
        step = float(self.fine_nm[1] - self.fine_nm[0])
        seen = np.linalg.norm(self.fine_design, axis=0) / step
        inside = self.fine_nm[seen * self.power > SEEN_SIGMA]
        if not len(inside):
            return float(self.fine_nm[0]), float(self.fine_nm[-1])
        low, high = self.fine_nm[0] + self.margin_nm, self.fine_nm[-1] - self.margin_nm
        return float(max(low, inside[0])), float(min(high, inside[-1]))

    def columns(self, features: Sequence[Feature]) -> FloatArray:
        """Return the whitened values (k, m) of features of power 1."""
        rows = [one.seen_by(self.fine_design, self.fine_nm) for one in features]
        return np.array(rows).reshape(-1, len(self.target))

    @cached_property
    def log_none(self) -> FloatArray:
        """Log evidence of every weight without features, shape (weights,)."""
        z = (self.at_places @ self.target) / np.sqrt(self.variance_at_places)
        result: FloatArray = self.log_smooth + log_ndtr(z).sum(axis=1)
        return result

    def of_one_feature(self) -> tuple[list[Feature], FloatArray]:
        """Return f features on a grid, and the log evidence (weights, f) with each of them.

        That the smooth spectrum is not negative is ignored, as by `log_smooth`.
        """
        grid_nm = np.arange(*self.range_nm, TRIED * self.margin_nm)
        features = [
            Feature(float(nm), float(fwhm_nm / FWHM_OVER_SIGMA))
            for fwhm_nm in TRIED_FWHM_NM
            for nm in grid_nm
        ]
        tried = self.columns(features)
        result = np.empty((len(self.smooth), len(tried)))
        direct, length2 = tried @ self.target, np.einsum("ij,ij->i", tried, tried)
        for number, smooth in enumerate(self.smooth):
            explained = tried @ smooth.T
            rest = np.maximum(length2 - np.einsum("ij,ij->i", explained, explained), 0.0)
            information = rest + self.power**-2
            z = (direct - explained @ self.along[number]) / np.sqrt(information)
            occam = np.log(2) - np.log(information * self.power**2) / 2
            result[number] = self.log_smooth[number] + z**2 / 2 + occam + log_ndtr(z)
        return features, result

    def of_weights(self, columns: FloatArray) -> FloatArray:
        """Return the log evidence of all weights with features of the given values (k, m)."""
        if not len(columns):
            return self.log_none
        explained = columns @ self.smooth.swapaxes(1, 2)
        information = columns @ columns.T - explained @ explained.swapaxes(1, 2)
        information += np.eye(len(columns)) / self.power**2
        linear = columns @ self.target - (explained @ self.along[:, :, np.newaxis])[:, :, 0]
        inverse = np.linalg.inv(np.linalg.cholesky(information))
        return np.array(
            [
                self._log(columns, weight, inverse[weight], linear[weight])
                for weight in range(len(self.smooth))
            ]
        )

    def of_weight(self, columns: FloatArray, weight: int) -> float:
        """Return the log evidence of a weight, by its index, with features of the given values."""
        if not len(columns):
            return float(self.log_none[weight])
        inverse, linear = self._power_problem(columns, weight)
        return self._log(columns, weight, inverse, linear)

    def powers(self, columns: FloatArray, weight: int) -> FloatArray:
        """Return the mean powers (k,) of features of the given values."""
        inverse, linear = self._power_problem(columns, weight)
        powers: FloatArray = (inverse @ linear) @ inverse
        return powers

    def _power_problem(self, columns: FloatArray, weight: int) -> tuple[FloatArray, FloatArray]:
        """Return the inverse root of the powers' information, and their linear term."""
        explained = columns @ self.smooth[weight].T
        information = columns @ columns.T - explained @ explained.T
        information.flat[:: len(columns) + 1] += self.power**-2
        # SciPy's and NumPy's own functions take ten times as long to call as to run.
        lower, info = lapack.dpotrf(information, lower=1)
        if info:
            raise LinAlgError("expected a positive definite matrix")
        inverse, _ = lapack.dtrtri(lower, lower=1)
        return inverse, columns @ self.target - explained @ self.along[weight]

    def _log(
        self, columns: FloatArray, weight: int, inverse: FloatArray, linear: FloatArray
    ) -> float:
        whitened = inverse @ linear
        power = whitened @ inverse
        z_power = power / np.sqrt((inverse**2).sum(axis=0))
        lever = self.at_places[weight] @ columns.T
        level = self.at_places[weight] @ self.target - lever @ power
        variance = self.variance_at_places[weight] + ((lever @ inverse.T) ** 2).sum(axis=1)
        occam = np.log(2 * inverse.diagonal() / self.power).sum()
        positive = log_ndtr(z_power).sum() + log_ndtr(level / np.sqrt(variance)).sum()
        return float(self.log_smooth[weight] + whitened @ whitened / 2 + occam + positive)


def evidence_of(
    target: FloatArray,
    design: FloatArray,
    fine_design: FloatArray,
    fine_nm: FloatArray,
    precisions: Sequence[FloatArray],
    log_determinants: FloatArray,
) -> Evidence:
    """Prepare the evidence for whitened values.

    Parameters
    ----------
    target, design, fine_design
        Whitened values (m,), their design on the knots (m, n) and on those of lines (m, q).
    fine_nm
        Knots of lines, shape (q,).
    precisions, log_determinants
        Precision (n, n) of the prior at every weight, and the logarithm of its determinant.
    """
    places = np.arange(PLACES // 2, design.shape[1], PLACES)
    smooth, at_places, variances, logs = [], [], [], []
    for precision, log_prior in zip(precisions, log_determinants.tolist(), strict=True):
        lower = np.linalg.cholesky(design.T @ design + precision)
        smooth.append(solve_triangular(lower, design.T, lower=True))
        along = smooth[-1] @ target
        logs.append((log_prior + along @ along) / 2 - np.log(np.diag(lower)).sum())
        root = solve_triangular(lower, np.eye(len(lower))[:, places], lower=True)
        at_places.append(root.T @ smooth[-1])
        variances.append((root**2).sum(axis=0) + TOLERATED**2)
    stacked = np.array(smooth)
    return Evidence(
        target, fine_design, fine_nm, stacked, stacked @ target, np.array(logs),
        np.array(at_places), np.array(variances), float(fine_nm[-1] - fine_nm[0]),
    )  # fmt: skip
