"""The material that best glows as wanted (section 6 of Nalbach et al., eq. 7)."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from labrig.design.bands import DesignBands
from labrig.design.determined import POOR, POOR_ALBEDO, Conflict, Estimate, conflicts, covariance
from labrig.design.energy import keeping_energy
from labrig.design.keys import Keys
from labrig.design.light import LightProgramme
from labrig.design.linear_part import Coefficients, Wanted, linear_part
from labrig.design.possible import impossible_keys
from labrig.design.result import Design
from labrig.design.search import (
    PREFERENCE,
    Found,
    Problem,
    residuals_and_slopes,
    search,
    search_near,
)
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.material import MAX_ORDER

#: Most states of a design: a person's keys do not determine more.
MAX_STATES = 2
#: Relative σ with which a key is meant: a luminance that differs by 2 % looks the same.
KEY_SIGMA = 0.02
#: Light at all keys, over the strongest, below which a design near another keeps its albedo.
FAINT = 0.01
#: Bands lit in proportion whose names are all written.
MAX_JOINED = 3
#: Factor within its range from which a rate is not held by an end of it.
INSIDE = 1.01
#: Keys above which it is not asked which work against each other.
MAX_COMPARED = 60


def solve(
    programme: LightProgramme,
    keys: Keys,
    bands: DesignBands,
    *,
    n_states: int = 1,
    order: float | None = 1.0,
    albedo: ArrayLike | None = None,
    weights: Literal["luminance", "plain"] = "luminance",
    key_sigma: float = KEY_SIGMA,
    energy: Literal["free", "kept"] = "free",
    near: Design | None = None,
    held: float = PREFERENCE,
) -> Design:
    """Find the phosphorescent material whose radiance is closest to the keys.

    The glow of other places is ignored, as in the paper. Λ and the albedo follow from the rates by
    linear least squares with bounds; the rates are searched for in several basins.

    Parameters
    ----------
    programme
        Irradiance on the places over time; states are empty before its start.
    keys
        Wanted radiances, reflected light included.
    bands
        Bands of the irradiance.
    n_states
        Number of states, 1 or 2.
    order
        Kinetic order b of the states, 1 to 4; None searches for it, too.
    albedo
        Albedo, one or of each band; None finds it, too.
    weights
        `luminance`: residuals are relative to each key's own luminance, so that faint keys count;
        `plain`: squares are summed as in eq. 7.
    key_sigma
        Relative σ with which keys are meant, for the σ of the parameters.
    energy
        `free`: a design that emits more than it absorbs is returned, and said to be impossible;
        `kept`: the nearest that does not, under light of any band.
    near
        Design under nearly the same light, from whose rates alone is searched, so that what keys do
        not determine stays as it is.
    held
        Relative error of the keys for which a rate departs from that of `near` by a factor of e.

    Returns
    -------
    Design
        Parameters, residuals of the keys, and what is not possible.

    Raises
    ------
    UsageError
        An argument is outside of its range, or numbers of bands or places disagree.

    References
    ----------
    O. Nalbach, H.-P. Seidel, T. Ritschel, *Practical Capture and Reproduction of Phosphorescent
    Appearance* (2017), section 6.

    Examples
    --------
    A light of 10 s, then darkness; green after 1 s and at a tenth after 20 s:

    >>> import numpy as np
    >>> from labrig.design import Keys, LightProgramme, solve, three_bands
    >>> light = LightProgramme.checked([0.0, 10.0], [[1.0, 1.0, 1.0], [0.0, 0.0, 0.0]])
    >>> keys = Keys.checked(0, [11.0, 30.0], [[0.001, 0.01, 0.002], [0.0001, 0.001, 0.0002]])
    >>> design = solve(light, keys, three_bands(), albedo=0.5)
    >>> round(float(design.k_r_per_s[0]), 4), bool(design.delta_e2000.max() < 0.1)
    (0.1212, True)
    """
    _check(programme, keys, bands, n_states, order, key_sigma)
    given = None if albedo is None else _albedo(albedo, bands)
    reflected = programme.at(keys.place, keys.time_s) / np.pi
    unseen: tuple[Estimate, ...] = ()
    if given is None and _is_dark(programme, reflected, near):
        # One unknown less: no key is lit, so that any albedo does as well as none.
        given = np.zeros(bands.count) if near is None else near.albedo
        unseen = tuple(
            Estimate(f"albedo {band}", float(value), np.inf, "", False)
            for band, value in zip(bands.names, given, strict=True)
        )
    seen = bands.to_rgb if keys.is_colour(bands) else None
    target = keys.radiance
    if given is not None:
        light = given * reflected
        target = target - (light if seen is None else light @ seen.T)
    linear = linear_part(
        Wanted(target, keys.weights(bands, weights), reflected if given is None else None, seen)
    )
    problem = Problem.of(programme, keys.place, keys.time_s, linear, n_states)
    if near is None:
        ends = search(problem, is_order_free=order is None, order=order or 1.0)
    else:
        rates = np.column_stack([problem.of_groups(near.k_e_per_s), near.k_r_per_s])
        problem = replace(problem, around=rates, held=held)
        ends = search_near(problem, is_order_free=order is None, order=order or near.order)
    best = ends[0]
    if energy == "kept":
        best = keeping_energy(problem, ends, given, bands.energy)
    estimates, fights = _judged(problem, best, keys, bands, key_sigma)
    k_e = np.zeros((n_states, bands.count))
    is_lit = problem.groups >= 0
    k_e[:, is_lit] = best.rates[:, problem.groups[is_lit]]
    found = best.coefficients
    design = Design(
        programme=programme,
        keys=keys,
        bands=bands,
        k_r_per_s=best.rates[:, -1],
        k_e_per_s=k_e,
        order=best.order,
        reradiation=found.reradiation,
        albedo=given if given is not None else np.asarray(found.albedo),
        cost=best.cost,
        other_costs=tuple(end.cost for end in ends[1:]),
        estimates=(*estimates, *unseen),
        conflicts=fights,
        impossible=(),
    )
    return design.with_impossible(impossible_keys(design))


def _is_dark(programme: LightProgramme, reflected: FloatArray, near: Design | None) -> bool:
    """Return whether no key tells the albedo; a glow that is reflected tells next to nothing."""
    light = FAINT * float(programme.irradiance.max()) / np.pi if near is not None else 0.0
    return float(reflected.max()) <= light


def _check(
    programme: LightProgramme,
    keys: Keys,
    bands: DesignBands,
    n_states: int,
    order: float | None,
    key_sigma: float,
) -> None:
    if not keys.count:
        raise UsageError("expected at least one key, got none; say when it should glow how")
    if not 1 <= n_states <= MAX_STATES:
        raise UsageError(f"expected 1 or {MAX_STATES} states, got {n_states}")
    if order is not None and not 1 <= order <= MAX_ORDER:
        raise UsageError(f"expected a kinetic order from 1 to {MAX_ORDER:g}, got {order:g}")
    if not 0 < key_sigma < 1:
        raise UsageError(f"expected a relative σ of keys between 0 and 1, got {key_sigma:g}")
    if programme.irradiance.shape[2] != bands.count:
        raise UsageError(
            f"expected an irradiance of {bands.count} bands, got {programme.irradiance.shape[2]}"
        )
    if keys.place.min() < 0 or keys.place.max() >= programme.n_places:
        raise UsageError(
            f"expected places 0 to {programme.n_places - 1} of the light programme, got "
            f"{keys.place.min()} to {keys.place.max()}"
        )


def _albedo(albedo: ArrayLike, bands: DesignBands) -> FloatArray:
    given = np.asarray(albedo, dtype=np.float64)
    if given.shape not in ((), (bands.count,)) or not ((given >= 0) & (given <= 1)).all():
        raise UsageError(
            f"expected an albedo from 0 to 1, one or {bands.count}, got {given.tolist()}"
        )
    return np.broadcast_to(given, (bands.count,)).copy()


def _judged(
    problem: Problem, best: Found, keys: Keys, bands: DesignBands, key_sigma: float
) -> tuple[tuple[Estimate, ...], tuple[Conflict, ...]]:
    """Return the parameters with their σ, and the keys that work against each other."""
    x = problem.coordinates(best.rates)
    residuals, by_rate, values, coefficients = residuals_and_slopes(
        problem, x, best.order, best.coefficients
    )
    n_rows = problem.linear.n_rows
    residuals = residuals[:n_rows]
    n_rates = problem.n_states * problem.n_rates
    n_nonlinear = n_rates + (best.order != 1)
    blocks = list(problem.linear.blocks(values, coefficients))
    columns = [by_rate[:n_rows, :n_nonlinear]]
    is_free = [np.ones(n_nonlinear, dtype=np.bool_)]
    for block in blocks:
        whole = np.zeros((n_rows, block.columns.shape[1]))
        rows = slice(block.rows.start, min(block.rows.stop, n_rows))
        whole[rows] = block.columns[: rows.stop - rows.start]
        columns.append(whole)
        is_free.append(block.is_free)
    jacobian = np.concatenate(columns, axis=1)
    # Keys that are met worse than they are meant tell less.
    dof = max(n_rows - int(np.concatenate(is_free).sum()), 1)
    missed = math.sqrt(float(residuals @ residuals) / dof)
    sigma = max(key_sigma, missed) * np.sqrt(np.diag(covariance(jacobian)))
    estimates = [
        *_rates(problem, best, sigma[:n_rates], bands),
        *_order(best, sigma[n_rates:n_nonlinear]),
        *_linear(coefficients, _by_band(sigma[n_nonlinear:], len(blocks), bands), bands),
    ]
    fights: tuple[Conflict, ...] = ()
    if problem.n_keys <= MAX_COMPARED:
        key_of_row = np.tile(np.arange(problem.n_keys), n_rows // problem.n_keys)
        fights = conflicts(residuals, jacobian[:, np.concatenate(is_free)], key_of_row)
    return tuple(estimates), fights


def _rates(
    problem: Problem, best: Found, sigma: FloatArray, bands: DesignBands
) -> Sequence[Estimate]:
    estimates = []
    slopes = np.column_stack([problem.k_e_slopes(best.rates), best.rates[:, -1]])
    sigmas = sigma.reshape(best.rates.shape) * slopes
    slowest, fastest = problem.k_r_range
    for state, (rates, own) in enumerate(zip(best.rates, sigmas, strict=True)):
        label = f" {state + 1}" if problem.n_states > 1 else ""
        is_inside = slowest * INSIDE < rates[-1] < fastest / INSIDE
        is_known = bool(own[-1] < POOR * rates[-1] and is_inside)
        estimates.append(Estimate(f"k_r{label}", float(rates[-1]), float(own[-1]), "1/s", is_known))
        excited = float((rates[:-1] * problem.strongest).max(initial=0.0))
        for group in np.unique(problem.groups).tolist():
            # Of bands that are always lit in proportion only a sum is known.
            members = np.flatnonzero(problem.groups == group)
            name = f"k_e{label} {_joined([bands.names[band] for band in members])}"
            if group < 0:
                estimates.append(Estimate(name, 0.0, np.inf, "1/s", False))
                continue
            is_known = bool(own[group] * problem.strongest[group] < POOR * excited)
            value, its_sigma = float(rates[group]), float(own[group])
            estimates.append(Estimate(name, value, its_sigma, "1/s", is_known))
    return estimates


def _joined(names: Sequence[str]) -> str:
    """Return the names of bands, of many the first and the last."""
    many = len(names) > MAX_JOINED
    return f"{names[0]} … {names[-1]}" if many else " + ".join(names)


def _order(best: Found, sigma: FloatArray) -> Sequence[Estimate]:
    return [Estimate("order", best.order, float(each), "", bool(each < POOR)) for each in sigma]


def _by_band(sigma: FloatArray, n_blocks: int, bands: DesignBands) -> FloatArray:
    """Return σ of Λ of the states and of the albedo, shape (bands, unknowns)."""
    is_band_by_band = n_blocks == bands.count
    return sigma.reshape(bands.count, -1) if is_band_by_band else sigma.reshape(-1, bands.count).T


def _linear(
    coefficients: Coefficients, sigma: FloatArray, bands: DesignBands
) -> Sequence[Estimate]:
    n_states = len(coefficients.reradiation)
    estimates = []
    for state, values in enumerate(coefficients.reradiation):
        label = f" {state + 1}" if n_states > 1 else ""
        poor = POOR * float(values.max())
        for band, value, own in zip(bands.names, values, sigma[:, state], strict=True):
            name = f"Λ{label} {band}"
            estimates.append(Estimate(name, float(value), float(own), "s/sr", bool(own <= poor)))
    if coefficients.albedo is not None:
        for band, value, own in zip(bands.names, coefficients.albedo, sigma[:, -1], strict=True):
            is_known = bool(own < POOR_ALBEDO)
            estimates.append(Estimate(f"albedo {band}", float(value), float(own), "", is_known))
    return estimates
