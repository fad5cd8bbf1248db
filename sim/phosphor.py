"""The samples: rate equations of all states of all patches, integrated along the light.

Eq. 1 of Nalbach et al. is integrated as it stands, by an explicit Runge–Kutta method of order 8
(DOP853). Nothing here knows a solution of it: that is what labrig's fits are tested against.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from labrig.errors import UsageError
from labrig.material.file import Material, State

from .lamp import BURNING_K, CELL_EDGES_NM, CELL_NM, filament_spectrum

FloatArray = NDArray[np.float64]

#: Of the integration, relative; and absolute, of concentrations between 0 and 1.
RTOL = 1e-8
ATOL = 1e-12

#: Level of a fully charged state of which neither excitation rates nor a charge are known.
UNKNOWN_CHARGE = 0.5


class Light(Protocol):
    """What excites: a `Lamp`, or in tests anything with a known solution."""

    def corners(self, start_s: float, end_s: float) -> list[float]:
        """Times strictly between at which the light does not go on smoothly."""

    def dark(self, start_s: float, end_s: float) -> bool:
        """Whether there is no light at all from `start_s` to `end_s`."""

    def irradiance(self, time_s: float) -> FloatArray:
        """Relative spectral irradiance on `WAVELENGTH_NM`."""


@dataclass(frozen=True)
class Phosphor:
    """All states of all patches, flat.

    Attributes
    ----------
    k_r_per_s : ndarray, shape (states,)
    excitation : ndarray, shape (states, wavelengths)
        κ = excitation @ irradiance.
    patch : ndarray, shape (states,)
        Index of the patch, or part of one, that a state belongs to.
    quickening
        By how much re-radiation is faster at a time than `k_r_per_s` says.
    """

    k_r_per_s: FloatArray
    excitation: FloatArray
    patch: NDArray[np.intp]
    quickening: Callable[[float], float] = lambda _: 1.0

    def evolve(
        self,
        level: FloatArray,
        start_s: float,
        end_s: float,
        light: Light,
        visible: Callable[[float], float] = lambda _: 1.0,
    ) -> tuple[FloatArray, FloatArray]:
        """Let time pass.

        Parameters
        ----------
        level : ndarray, shape (states,)
            Concentrations r at `start_s`.
        start_s, end_s
            Of the interval.
        light
            What shines on the samples.
        visible
            Part v of the samples that is seen at a time; smooth where the light is.

        Returns
        -------
        level : ndarray, shape (states,)
            Concentrations at `end_s`.
        exposure_s : ndarray, shape (states,)
            ∫ v q r dt from `start_s` to `end_s`, with q the `quickening`.
        """
        state = np.concatenate([level, np.zeros_like(level)])
        corners = [start_s, *light.corners(start_s, end_s), end_s]
        for left, right in pairwise(corners):
            if right > left:
                state = self._smooth(state, left, right, light, visible)
        count = len(level)
        return state[:count], state[count:]

    def _smooth(
        self,
        state: FloatArray,
        left: float,
        right: float,
        light: Light,
        visible: Callable[[float], float],
    ) -> FloatArray:
        excitation, count = self.excitation, len(self.k_r_per_s)

        def in_the_dark(time_s: float, y: FloatArray) -> FloatArray:
            faster, r = self.quickening(time_s), y[:count]
            return np.concatenate([-faster * self.k_r_per_s * r, visible(time_s) * faster * r])

        def lit(time_s: float, y: FloatArray) -> FloatArray:
            faster, r = self.quickening(time_s), y[:count]
            charging = (1 - r) * (excitation @ light.irradiance(time_s))
            return np.concatenate(
                [charging - faster * self.k_r_per_s * r, visible(time_s) * faster * r]
            )

        rates = in_the_dark if light.dark(left, right) else lit
        solution = solve_ivp(
            rates, (left, right), state, method="DOP853", rtol=RTOL, atol=ATOL, t_eval=[right]
        )
        if not solution.success:
            raise ArithmeticError(f"the rate equations cannot be integrated: {solution.message}")
        end: FloatArray = solution.y[:, -1]
        return end


def phosphor(
    materials: Sequence[Material], charges: Sequence[float | None], irradiance: float
) -> Phosphor:
    """The states of one patch after the other.

    Parameters
    ----------
    materials
        Of every patch.
    charges
        Level of every patch after a long charge, where given.
    irradiance
        Of the warm lamp in multiples of the norm of a material's excitation rates.
    """
    rows = [
        (state.k_r_per_s, _excitation(material, state, charge, irradiance), index)
        for index, (material, charge) in enumerate(zip(materials, charges, strict=True))
        for state in material.states
    ]
    k_r, excitation, patch = zip(*rows, strict=True)
    return Phosphor(np.array(k_r), np.array(excitation), np.array(patch, dtype=np.intp))


def _excitation(
    material: Material, state: State, charge: float | None, irradiance: float
) -> FloatArray:
    """Row of the excitation matrix: κ per unit of the lamp's relative irradiance, per cell."""
    full = filament_spectrum(BURNING_K)
    if charge is not None or state.k_e_per_s is None:
        level = UNKNOWN_CHARGE if charge is None else charge
        # κ/(κ + k_r) = level under the burning lamp, all wavelengths taking their part.
        row: FloatArray = np.full_like(full, state.k_r_per_s * level / (1 - level) / full.sum())
        return row
    if material.bands_nm is None or material.irradiance_norm is None:
        raise UsageError(f"{material.name}: excitation rates need 'bands_nm', 'irradiance_norm'")
    cells = band_cells(material.bands_nm)
    length = float(np.linalg.norm(cells @ full))
    scale = irradiance * material.irradiance_norm.value / length
    row = scale * (np.asarray(state.k_e_per_s) @ cells)
    return row


def band_cells(bands_nm: Sequence[float]) -> FloatArray:
    """Which part of every cell of the grid lies in every band, shape (bands, wavelengths)."""
    edges = np.asarray(bands_nm)
    low = np.maximum(edges[:-1, None], CELL_EDGES_NM[None, :-1])
    high = np.minimum(edges[1:, None], CELL_EDGES_NM[None, 1:])
    part: FloatArray = np.clip(high - low, 0.0, None) / CELL_NM
    return part
