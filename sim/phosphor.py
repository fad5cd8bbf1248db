"""The samples: rate equations of all states of all patches, integrated along the light.

Eq. 1 of Nalbach et al. is integrated as it stands, by collocation at the nodes of Gauss and
Legendre (an implicit Runge–Kutta method of order 16). No analytical solution is used, since
labrig's fits are tested against this simulation. Samples with other `kinetics` consist of traps,
which `traps` integrates.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.material import Material, State

from .kinetics import KineticsSettings, Law, Traps, depths_of, law_of, layers_of, rate_in_the_middle
from .lamp import BURNING_K, CELL_EDGES_NM, CELL_NM, filament_spectrum
from .traps import Drive, integrate

#: A step may differ by so much from its two halves, relative; and absolute, of concentrations
#: between 0 and 1. The halves, which are kept, are better by orders of magnitude.
RTOL = 1e-8
ATOL = 1e-13
#: Nodes of a step; its order is twice that.
STAGES = 8
#: The next step is not shorter than the last by more than this factor, nor longer.
SHORTER, LONGER = 0.1, 10.0
#: Least error, to avoid division by zero.
TINY = 1e-30

#: Level of a fully charged state of which neither excitation rates nor a charge are known.
UNKNOWN_CHARGE = 0.5


def _collocation() -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return nodes and weights between 0 and 1, integrals up to the nodes, extrapolation to 1.

    With values f at the nodes, ∫f up to node i is `integrals[i] @ f`, and that up to 1
    `weights @ f` or, from the integrals themselves, `extrapolation @ (integrals @ f)`.
    """
    nodes, weights = legendre.leggauss(STAGES)
    coefficients = np.linalg.inv(legendre.legvander(nodes, STAGES - 1))
    below = legendre.legval(nodes, legendre.legint(coefficients, lbnd=-1)).T
    integrals = np.asarray(below, dtype=np.float64)
    extrapolation = weights @ np.linalg.inv(integrals)
    return (nodes + 1) / 2, weights / 2, integrals / 2, extrapolation


NODES, WEIGHTS, INTEGRALS, EXTRAPOLATION = _collocation()


class Light(Protocol):
    """Light that excites: a `Lamp`, or in tests any light with a known solution."""

    def corners(self, start_s: float, end_s: float) -> list[float]:
        """Return the times strictly between at which the light is not smooth."""

    def dark(self, start_s: float, end_s: float) -> bool:
        """Return whether there is no light at all from `start_s` to `end_s`."""

    def irradiance(self, time_s: FloatArray) -> FloatArray:
        """Return the relative spectral irradiance at every time, shape (times, wavelengths)."""


@dataclass(frozen=True)
class Phosphor:
    """All states of all patches in one array.

    Attributes
    ----------
    k_r_per_s : ndarray, shape (states,)
        Re-radiation rates in 1/s.
    excitation : ndarray, shape (states, wavelengths)
        Excitation matrix, κ = excitation @ irradiance.
    patch : ndarray, shape (states,)
        Index of the patch, or part of one, to which a state belongs.
    rate_factor
        Function of time: factor by which re-radiation is faster than `k_r_per_s`.
    traps
        Traps of which the states consist, each a row of these arrays; None if every state is a row
        of its own and follows the rate equation.
    """

    k_r_per_s: FloatArray
    excitation: FloatArray
    patch: NDArray[np.intp]
    rate_factor: Callable[[float], float] = lambda _: 1.0
    traps: Traps | None = None

    def of(self, index: NDArray[np.intp], patch: NDArray[np.intp]) -> "Phosphor":
        """Return some of the states, in the order of `index`, as belonging to other patches."""
        return replace(
            self,
            k_r_per_s=self.k_r_per_s[index],
            excitation=self.excitation[index],
            patch=patch,
            traps=None if self.traps is None else self.traps.of(index),
        )

    def evolve(
        self,
        level: FloatArray,
        start_s: float,
        end_s: float,
        light: Light,
        visible: Callable[[float], float] = lambda _: 1.0,
    ) -> tuple[FloatArray, FloatArray]:
        """Integrate the rate equations over an interval.

        Parameters
        ----------
        level : ndarray, shape (states,)
            Concentrations r at `start_s`.
        start_s, end_s
            Begin and end of the interval in seconds.
        light
            Light on the samples.
        visible
            Function of time: fraction v of the samples that is seen; smooth where the light is.

        Returns
        -------
        level : ndarray, shape (states,)
            Concentrations at `end_s`.
        exposure_s : ndarray, shape (states,)
            ∫ v q r dt from `start_s` to `end_s`, with q the `rate_factor`; of traps with a law of
            their own ∫ v e dt / k_r, with e the rate of emission.
        """
        if self.traps is not None:
            return self._by_laws(level, start_s, end_s, light, visible)
        state = np.array([level, np.zeros_like(level)])
        if not level.any() and not self.excitation.any():
            return state[0], state[1]
        corners = [start_s, *light.corners(start_s, end_s), end_s]
        for begin_s, stop_s in pairwise(corners):
            if stop_s > begin_s:
                state = self._smooth(state, begin_s, stop_s, light, visible)
        return state[0], state[1]

    def _by_laws(
        self,
        level: FloatArray,
        start_s: float,
        end_s: float,
        light: Light,
        visible: Callable[[float], float],
    ) -> tuple[FloatArray, FloatArray]:
        """Integrate each law's traps by themselves; see `evolve`."""
        assert self.traps is not None
        after, exposure_s = np.empty_like(level), np.empty_like(level)
        for own, law, some in self._by_law:
            if law is None:
                after[own], exposure_s[own] = some.evolve(
                    level[own], start_s, end_s, light, visible
                )
                continue
            state = np.array([level[own], np.zeros(len(own))])
            for begin_s, stop_s in pairwise([start_s, *light.corners(start_s, end_s), end_s]):
                if stop_s > begin_s:
                    is_dark = light.dark(begin_s, stop_s)
                    drive = partial(some._drive, None if is_dark else light, visible)
                    state = integrate(law, state, begin_s, stop_s, drive)
            after[own], exposure_s[own] = state[0], state[1] / some.k_r_per_s
        return after, exposure_s

    @cached_property
    def _by_law(self) -> list[tuple[NDArray[np.intp], Law | None, "Phosphor"]]:
        """Indices of the traps of each law, that law, and these traps; None: the rate equation."""
        assert self.traps is not None
        groups = []
        for number in np.unique(self.traps.law).tolist():
            own = np.flatnonzero(self.traps.law == number)
            some = self.of(own, self.patch[own])
            is_plain = number < 0
            law = None if is_plain else self.traps.laws[number]
            groups.append((own, law, replace(some, traps=None) if is_plain else some))
        return groups

    @cached_property
    def _excited(self) -> tuple[FloatArray, NDArray[np.intp]]:
        """The rows of the excitation matrix that differ from those before, and each trap's."""
        differs = np.any(self.excitation[1:] != self.excitation[:-1], axis=1)
        row = np.concatenate([[0], np.cumsum(differs)])
        return self.excitation[np.concatenate([[True], differs])], row

    def _drive(
        self, light: Light | None, visible: Callable[[float], float], times_s: FloatArray
    ) -> Drive:
        """Return what acts on traps at some times; without light it is dark."""
        assert self.traps is not None
        each_s = times_s.tolist()
        faster = np.array([self.rate_factor(at_s) for at_s in each_s])
        escape = self.k_r_per_s * faster[:, None] ** self.traps.activation
        generation = np.zeros_like(escape)
        if light is not None:
            rows, row = self._excited
            generation = (light.irradiance(times_s) @ rows.T)[:, row]
        return Drive(generation, escape, np.array([visible(at_s) for at_s in each_s]))

    def _smooth(
        self,
        state: FloatArray,
        begin_s: float,
        stop_s: float,
        light: Light,
        visible: Callable[[float], float],
    ) -> FloatArray:
        """Return levels and exposures at `right`, shape (2, states), confirmed by half steps."""
        shining = None if light.dark(begin_s, stop_s) else light
        start_s, step_s = begin_s, stop_s - begin_s
        while math.nextafter(start_s, stop_s) < stop_s:
            end_s = min(start_s + step_s, stop_s)
            middle_s = (start_s + end_s) / 2
            if not start_s < middle_s < end_s:
                raise ArithmeticError(f"the rate equations cannot be integrated at {start_s} s")
            spans = np.array([[start_s, end_s], [start_s, middle_s], [middle_s, end_s]])
            full_step, first_half, second_half = self._steps(spans, shining, visible)
            coarse, refined = full_step(state), second_half(first_half(state))
            error = np.max(np.abs(coarse - refined) / (ATOL + RTOL * np.abs(refined)))
            factor = 0.9 * max(error, TINY) ** (-1 / (2 * STAGES + 1))
            step_s = (end_s - start_s) * min(max(factor, SHORTER), LONGER)
            if error <= 1:
                start_s, state = end_s, refined
        return state

    def _steps(
        self, spans: FloatArray, light: Light | None, visible: Callable[[float], float]
    ) -> list["_Step"]:
        """Return the step of each of the `spans`, shape (spans, 2); without light it is dark."""
        lasting_s = np.diff(spans)
        times_s = spans[:, :1] + lasting_s * NODES
        each_s = times_s.ravel().tolist()
        faster = np.array([self.rate_factor(at_s) for at_s in each_s]).reshape(times_s.shape)
        visible_rate = np.array([visible(at_s) for at_s in each_s]).reshape(times_s.shape) * faster
        # In the dark states of one rate are alike, of which there may be hundreds.
        k_r_per_s, rate_index = self._rates if light is None else (self.k_r_per_s, np.s_[:])
        loss = faster[:, None, :] * k_r_per_s[:, None]
        charging = np.zeros_like(loss)
        if light is not None:
            kappa = light.irradiance(times_s.ravel()) @ self.excitation.T
            charging = kappa.reshape(*times_s.shape, -1).transpose(0, 2, 1)
        # r at the nodes is r at the beginning plus the integrals of dr/dt, which is linear in r.
        integrals_s = lasting_s[:, :, None, None] * INTEGRALS
        matrix = np.eye(STAGES) + integrals_s * (loss + charging)[:, :, None, :]
        charged = (integrals_s @ charging[..., None])[..., 0]
        levels = np.linalg.solve(matrix, np.stack([np.ones_like(charged), charged], axis=-1))
        end = EXTRAPOLATION @ levels
        end[..., 0] += 1 - EXTRAPOLATION.sum()
        exposure_s = ((lasting_s * WEIGHTS * visible_rate)[:, None, None, :] @ levels)[:, :, 0]
        columns = np.stack([end, exposure_s], axis=-1).transpose(0, 2, 3, 1)[..., rate_index]
        return [_Step(*step) for step in columns]

    @cached_property
    def _rates(self) -> tuple[FloatArray, NDArray[np.intp]]:
        """All different `k_r_per_s`, and the index of each state's among them."""
        return np.unique(self.k_r_per_s, return_inverse=True)


@dataclass(frozen=True)
class _Step:
    """Linear map of levels and exposures over a step, each shape (2, states).

    Attributes
    ----------
    factor
        Level and exposure at the step's end per level at its start.
    added
        Level and exposure at the step's end for a level of 0 at its start.
    """

    factor: FloatArray
    added: FloatArray

    def __call__(self, state: FloatArray) -> FloatArray:
        """Return levels and exposures after the step."""
        end: FloatArray = self.factor * state[0] + self.added
        end[1] += state[1]
        return end


def phosphor(
    materials: Sequence[Material],
    charges: Sequence[float | None],
    irradiance: float,
    kinetics: Sequence[KineticsSettings | None] = (),
) -> Phosphor:
    """Return the states of one patch after the other, or the traps of which they consist.

    Parameters
    ----------
    materials
        Material of every patch.
    charges
        Level of every patch after a long charge, where given.
    irradiance
        Irradiance of the warm lamp in multiples of the norm of a material's excitation rates.
    kinetics
        Kinetics of every patch; none: that of first order.
    """
    each = kinetics or [None] * len(materials)
    rows = [
        (
            state.k_r_per_s,
            _excitation(material, state, charge, irradiance, settings),
            index,
            law_of(settings, state.kinetic_order),
        )
        for index, (material, charge, settings) in enumerate(
            zip(materials, charges, each, strict=True)
        )
        for state in material.states
    ]
    k_r, excitation, patch, laws = zip(*rows, strict=True)
    states = Phosphor(np.array(k_r), np.array(excitation), np.array(patch, dtype=np.intp))
    return _of_traps(states, each, laws) if any(each) or any(laws) else states


def _of_traps(
    states: Phosphor, kinetics: Sequence[KineticsSettings | None], laws: Sequence[Law | None]
) -> Phosphor:
    """Return the traps of all states: of every depth, in every layer of the sample."""
    different = tuple(dict.fromkeys(law for law in laws if law is not None))
    rows = []
    for state, patch in enumerate(states.patch.tolist()):
        law, settings = laws[state], kinetics[patch]
        number = -1 if law is None else different.index(law)
        passed, thickness = layers_of(settings, states.excitation[states.patch == patch])
        depths = depths_of(settings, float(states.k_r_per_s[state]))
        rows += [
            (k_r, states.excitation[state] * light, patch, number, depth, share * layer, state)
            for light, layer in zip(passed, thickness, strict=True)
            for k_r, depth, share in zip(*depths, strict=True)
        ]
    k_r, excitation, of_patch, law_index, depth, share, of_state = zip(*rows, strict=True)
    return Phosphor(
        np.array(k_r),
        np.array(excitation),
        np.array(of_patch, dtype=np.intp),
        traps=Traps(
            law=np.array(law_index, dtype=np.intp),
            activation=np.array(depth),
            share=np.array(share),
            state=np.array(of_state, dtype=np.intp),
            laws=different,
        ),
    )


def _excitation(
    material: Material,
    state: State,
    charge: float | None,
    irradiance: float,
    kinetics: KineticsSettings | None,
) -> FloatArray:
    """Return a row of the excitation matrix: κ per unit of the lamp's irradiance, per cell."""
    spectrum = filament_spectrum(BURNING_K)
    if charge is not None or state.k_e_per_s is None:
        level = UNKNOWN_CHARGE if charge is None else charge
        # The burning lamp holds this level, all wavelengths taking their part.
        kappa_per_s = _holding(level, state, kinetics)
        row: FloatArray = np.full_like(spectrum, kappa_per_s / spectrum.sum())
        return row
    if material.bands_nm is None or material.irradiance_norm is None:
        raise UsageError(f"{material.name}: excitation rates need 'bands_nm', 'irradiance_norm'")
    cells = band_cells(material.bands_nm)
    length = float(np.linalg.norm(cells @ spectrum))
    scale = irradiance * material.irradiance_norm.value / length
    k_e_per_s = np.asarray(state.k_e_per_s)
    if kinetics is None:
        row = scale * (k_e_per_s @ cells)
        return row
    return scale * _over_wavelengths(k_e_per_s, material.bands_nm, kinetics)


def _over_wavelengths(
    k_e_per_s: FloatArray, bands_nm: Sequence[float], kinetics: KineticsSettings
) -> FloatArray:
    """Return excitation rates on the grid, whose means over the bands are `k_e_per_s`."""
    low_nm, high_nm = CELL_EDGES_NM[[0, -1]]
    edges = np.array([min(low_nm, bands_nm[0] - 1), *bands_nm, max(high_nm, bands_nm[-1] + 1)])
    beyond = kinetics.excitation_beyond * k_e_per_s[[0, -1]]
    rates = np.array([beyond[0], *k_e_per_s, beyond[1]])
    if kinetics.excitation == "steps":
        return np.asarray(rates @ band_cells(edges))
    running = PchipInterpolator(edges, np.concatenate([[0.0], np.cumsum(rates * np.diff(edges))]))
    return np.asarray(np.diff(running(CELL_EDGES_NM)) / CELL_NM)


def _holding(level: float, state: State, kinetics: KineticsSettings | None) -> float:
    """Return the κ that holds a level of the traps at the surface."""
    law = law_of(kinetics, state.kinetic_order)
    if law is None:
        return state.k_r_per_s * level / (1 - level)
    return law.generation(
        level, rate_in_the_middle(kinetics or KineticsSettings(), state.k_r_per_s)
    )


def band_cells(bands_nm: Sequence[float] | FloatArray) -> FloatArray:
    """Return the fraction of every cell of the grid in every band, shape (bands, wavelengths)."""
    edges = np.asarray(bands_nm)
    low = np.maximum(edges[:-1, None], CELL_EDGES_NM[None, :-1])
    high = np.minimum(edges[1:, None], CELL_EDGES_NM[None, 1:])
    part: FloatArray = np.clip(high - low, 0.0, None) / CELL_NM
    return part
