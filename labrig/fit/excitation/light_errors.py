"""How large the errors of the light are, as the glow itself says.

A calibration states the errors that it knows. That a lamp's brightness scatters from charge to
charge, or that places behind a filter do, is known by kind only; by how much shows in the glow,
since many charges and places share a few rates. A size that was assumed too large makes every σ too
large; one too small, too small. The size of each kind is found by its evidence: the probability of
the glow given the size, all other parameters integrated out, is a Gaussian integral of what one fit
with any size has found.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from labrig.fit.excitation.parameters import Parameters, RelativeSigmas, is_fitted
from labrig.fit.least_squares import LeastSquaresFit
from labrig.foundation.arrays import FloatArray
from labrig.results import ChargingSeries

#: Sizes of a kind of error that are tried, the denser the smaller they are.
TRIED = 13
#: Kind of the lamp's scatter, before those of the sites.
LAMP = 0


class LightErrors(NamedTuple):
    """Sizes of the errors of the light, relative to those given.

    Attributes
    ----------
    lamp
        Size of the lamp's scatter from charge to charge.
    sites
        Size of each kind of the sites' error modes.
    """

    lamp: float
    sites: tuple[float, ...]

    def applied(
        self, series: Sequence[ChargingSeries], uncertain: RelativeSigmas
    ) -> tuple[list[ChargingSeries], RelativeSigmas]:
        """Return the series and the scatter with errors of these sizes."""
        sizes = np.array([*self.sites, 1.0])
        scaled = [
            charging
            if charging.site_modes is None or charging.mode_kind is None
            else replace(
                charging, site_modes=charging.site_modes * sizes[charging.mode_kind][:, None, None]
            )
            for charging in series
        ]
        lamp = max(uncertain.lamp * self.lamp, uncertain.least_lamp)
        return scaled, replace(uncertain, lamp=lamp)


def found_errors(
    parameters: Parameters,
    solution: LeastSquaresFit,
    series: Sequence[ChargingSeries],
    largest: float,
) -> LightErrors:
    """Return the expected size of each kind of error.

    Before the fit, all roots of sizes up to the largest are as probable as each other. The expected
    size is not 0 where a size of 0 fits best.

    Parameters
    ----------
    parameters
        Layout of θ.
    solution
        Fit with errors of size 1.
    series
        The charging series.
    largest
        Largest size.
    """
    kind = _kinds(parameters, series)
    kinds = int(kind.max(initial=LAMP)) + 1
    sigma, first = parameters.prior_sigma, parameters.count - len(parameters.prior_sigma)
    covariance = solution.covariance[first:, first:] / np.outer(sigma, sigma)
    # What the glow alone says: the fit's information less that of its own prior.
    inverse = np.linalg.inv(covariance)
    values, vectors = np.linalg.eigh(inverse - np.eye(len(sigma)))
    information = (vectors * np.maximum(values, 0.0)) @ vectors.T
    linear = inverse @ (solution.parameters[first:] / sigma)
    step = np.linspace(0.0, 1.0, TRIED)
    steps = np.stack(np.meshgrid(*[step] * kinds, indexing="ij"), -1).reshape(-1, kinds)
    grid = largest * steps**2
    log_evidence = np.array(
        [_log_evidence(information, linear, np.append(sizes, 1.0)[kind]) for sizes in grid]
    )
    probability = np.exp(log_evidence - log_evidence.max())
    lamp, *sites = (probability @ grid / probability.sum()).tolist()
    return LightErrors(lamp, tuple(sites))


def _kinds(parameters: Parameters, series: Sequence[ChargingSeries]) -> NDArray[np.intp]:
    """Return the kind of every parameter with a prior; −1 for those of known size."""
    first, columns = parameters.count - len(parameters.prior_sigma), parameters.columns
    kind = np.full(len(parameters.prior_sigma), -1)
    if is_fitted(columns.brightness):
        kind[columns.brightness.start - first : columns.brightness.stop - first] = LAMP
    for number, charging in enumerate(series):
        if charging.mode_kind is not None:
            modes, begin = parameters.modes(number), columns.off.start - first
            of_sites = np.where(charging.mode_kind < 0, -1, charging.mode_kind + LAMP + 1)
            kind[begin + modes.start : begin + modes.stop] = of_sites
    return kind


def _log_evidence(information: FloatArray, linear: FloatArray, size: FloatArray) -> float:
    """Return the logarithm of the integral over all errors with standard deviations `size`."""
    precision = np.eye(len(size)) + size[:, None] * information * size
    lower = np.linalg.cholesky(precision)
    along = np.linalg.solve(lower, size * linear)
    return float(along @ along / 2 - np.log(np.diag(lower)).sum())
