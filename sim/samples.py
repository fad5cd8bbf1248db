"""The samples on the table: their charge, and the time up to which it is integrated."""

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.material import Albedo, Material, State, read_any_material

from .arrangement import Arrangement, Arrangements
from .lamp import BURNING_K, SETTLED_S, WAVELENGTH_NM, filament_spectrum
from .layout import Layout, Lvf
from .lights import Lights
from .optics import CLOTH_REFLECTANCE, REFLECTED, emission
from .phosphor import Light, Phosphor, phosphor
from .simulation import EMPTY, Simulation
from .temperature import rate_factor

#: Unit of the lamp's mean spectral irradiance among the factors of an absolute scale.
IRRADIANCE_UNIT = "W/m²/nm"
#: What an empty holder is: black.
NOTHING = Material(
    name="nothing",
    kind="phosphor",
    bands_nm=(400.0, 700.0),
    states=(State(k_r_per_s=1.0, reradiation=(0.0,)),),
    albedo=Albedo(wavelength_nm=(400.0, 700.0), value=(CLOTH_REFLECTANCE,) * 2),
)
#: What a sample that does not glow is among those that do.
DARK = Material(
    name="dark",
    kind="phosphor",
    bands_nm=(400.0, 700.0),
    states=(State(k_r_per_s=1.0, reradiation=(0.0,)),),
)


class NoLight:
    """The light in a dark place; as `Light`."""

    def corners(self, start_s: float, end_s: float) -> list[float]:
        """Return no times: nothing changes."""
        return []

    def dark(self, start_s: float, end_s: float) -> bool:
        """Return True: it never shines."""
        return True

    def irradiance(self, time_s: FloatArray) -> FloatArray:
        """Return the relative spectral irradiance at every time, shape (times, wavelengths)."""
        return np.zeros((len(time_s), len(WAVELENGTH_NM)))


class Samples:
    """All states of the samples in one array: of whole patches, or of their cells.

    Only an LVF that lies on a sample makes its cells differ. Until then, and again with a fresh
    sample, patches are integrated as wholes.

    Parameters
    ----------
    simulation
        Settings of the room.
    layout
        Layout of the picture into cells.
    place
        Place of the sample changer on which they lie, from 1 on; None without a changer.
    leak
        Light that reaches them while they are not in place, as a fraction.

    Attributes
    ----------
    materials
        Material of every patch: a phosphor, or the matrix of a fluorescent material.
    cells : Phosphor
        States of the cells; `patch` is the cell to which a state belongs.
    state, share : ndarray, shape (states,)
        Index of a cell's state among those of all materials, and the fraction of it: all, or with
        other kinetics that of some traps.
    radiance_at_one : ndarray, shape (states, wavelengths)
        Λ k_r of every state of the cells: its radiance at r = 1 (eq. 3).
    """

    def __init__(
        self,
        simulation: Simulation,
        layout: Layout,
        place: int | None = None,
        leak: float = 0.0,
    ) -> None:
        self._place, self._leak = place, leak
        self.materials = [
            NOTHING if patch.material == EMPTY else read_any_material(patch.material)
            for patch in simulation.patches
        ]
        phosphors = [
            material if isinstance(material, Material) else DARK for material in self.materials
        ]
        charges = [patch.initial_charge for patch in simulation.patches]
        kinetics = [patch.kinetics for patch in simulation.patches]
        for patch, material in zip(simulation.patches, self.materials, strict=True):
            if patch.kinetics is not None and not isinstance(material, Material):
                raise UsageError(
                    f"{material.name}: expected 'kinetics' with a phosphor, got it with a "
                    "re-radiation matrix, which has no states"
                )
            if patch.kinetics is not None and patch.kinetics.model != "first_order":
                _refuse_two_laws(material, patch.kinetics.model)
        self._patches = replace(
            phosphor(phosphors, charges, simulation.lamp.irradiance, kinetics),
            rate_factor=rate_factor(simulation.temperature),
        )
        patch_states = [np.flatnonzero(self._patches.patch == n) for n in range(len(phosphors))]
        states = [patch_states[patch - 1] for patch in layout.patch[1:]]
        self._state_of_cells = np.concatenate(states)
        cell = np.repeat(np.arange(1, len(layout.patch)), [len(index) for index in states])
        self.cells = self._patches.of(self._state_of_cells, cell)
        # States are in the order of their cells, and every cell but the cloth has some.
        _, self._first_state, self._state_count = np.unique(
            cell, return_index=True, return_counts=True
        )
        brightnesses = [patch.brightness for patch in simulation.patches]
        irradiance = simulation.lamp.irradiance
        emitted = np.concatenate(
            [
                brightness * in_table_scale(material, irradiance) * emission(material)
                for brightness, material in zip(brightnesses, phosphors, strict=True)
            ]
        )
        state, share = np.arange(len(emitted)), np.ones(len(emitted))
        if (traps := self._patches.traps) is not None:
            state, share = traps.state, traps.share
            emitted = emitted[state] * share[:, None]
        self.state, self.share = state[self._state_of_cells], share[self._state_of_cells]
        self.radiance_at_one: FloatArray = (emitted * self._patches.k_r_per_s[:, None])[
            self._state_of_cells
        ]
        self._piece = layout.piece[cell]
        self._lvf = simulation.lvf
        self._has_door = simulation.door is not None
        self._below_lvf: dict[bool, Phosphor] = {}
        # Where they have been followed to, by time. The past cannot change, so they stay true; a
        # photograph that is looked at late starts from the last one before it.
        self._times_s = [0.0]
        self._levels = [np.full_like(self._patches.k_r_per_s, simulation.initial.concentration)]

    def freshen(self, now_s: float, lights: Lights, arrangements: Arrangements) -> None:
        """Replace the samples by others of the same materials, long in the dark."""
        self.level_at(now_s, lights, arrangements)
        self._times_s.append(now_s)
        self._levels.append(np.zeros_like(self._patches.k_r_per_s))

    def level_at(self, time_s: float, lights: Lights, arrangements: Arrangements) -> FloatArray:
        """Return the concentrations of all states at a time, for `evolve` and `of_cells`."""
        last = bisect_right(self._times_s, time_s) - 1
        level = self._levels[last]
        for begin_s, stop_s, arrangement in arrangements.spans(self._times_s[last], time_s):
            level, _ = self.evolve(level, begin_s, stop_s, arrangement, lights)
        self._times_s.insert(last + 1, time_s)
        self._levels.insert(last + 1, level)
        return level

    def evolve(
        self,
        level: FloatArray,
        start_s: float,
        end_s: float,
        arrangement: Arrangement,
        light: Light,
        visible: Callable[[float], float] = lambda _: 1.0,
    ) -> tuple[FloatArray, FloatArray]:
        """Integrate over time on a bench that does not change; see `Phosphor.evolve`."""
        on_top = arrangement.card in ("grey card", "colorchecker") and not self._has_door
        is_away = self._place is not None and arrangement.in_place != self._place
        if arrangement.lvf == "on sample" and not is_away:
            level, states = self.of_cells(level), self._below(turned=arrangement.turned)
        else:
            are_patches = len(level) == len(self._patches.k_r_per_s)
            states = self._patches if are_patches else self.cells
        if is_away:
            states = replace(states, excitation=self._leak * states.excitation)
            light = light if self._leak else NoLight()
        elif arrangement.card == "blank" or on_top:
            states = replace(states, excitation=np.zeros_like(states.excitation))
        return states.evolve(level, start_s, end_s, light, visible)

    def extrapolated(self, at_off: FloatArray, later: FloatArray, off_s: float) -> FloatArray:
        """Return the concentrations of all cells, extrapolated from the dark back to lamp off.

        Parameters
        ----------
        at_off, later
            Concentrations at `off_s`, and `SETTLED_S` after it.
        off_s
            Time of the lamp off, in seconds.

        Returns
        -------
        ndarray, shape (states,)
            With kinetics of their own, the present emission in the dark per rate instead.
        """
        faster = self.cells.rate_factor(off_s)
        k_r_per_s, traps = self.cells.k_r_per_s, self.cells.traps
        if traps is None:
            return self.of_cells(later) * np.exp(faster * k_r_per_s * SETTLED_S)
        effective = traps.relative_emission(self.of_cells(at_off), k_r_per_s, faster)
        plain = traps.law < 0
        growth = np.exp(faster * k_r_per_s[plain] * SETTLED_S)
        effective[plain] = self.of_cells(later)[plain] * growth
        return effective

    def of_cells(self, level: FloatArray) -> FloatArray:
        """Return the concentrations for every state of every cell, shape (states,)."""
        return level if len(level) == len(self._state_of_cells) else level[self._state_of_cells]

    def glow(
        self,
        level: FloatArray,
        start_s: float,
        end_s: float,
        arrangement: Arrangement,
        lights: Lights,
    ) -> FloatArray:
        """Return ∫ visible radiance dt of all cells, shape (cells, wavelengths); cell 0 is cloth.

        Parameters
        ----------
        level
            Concentrations at `start_s`.
        start_s, end_s
            Begin and end of the interval in seconds.
        arrangement
            Arrangement of the bench until `end_s`.
        """
        visible = lights.openness
        if arrangement.card == "lit sample" and self._has_door:

            def visible(time_s: float) -> float:
                return 1 - lights.openness(time_s)

        _, exposure_s = self.evolve(level, start_s, end_s, arrangement, lights, visible)
        radiance_s = self.of_cells(exposure_s)[:, None] * self.radiance_at_one
        of_cells: FloatArray = np.zeros((len(self._first_state) + 1, radiance_s.shape[1]))
        of_cells[1:] = radiance_s[self._first_state]
        # Most have one or two, of which numpy's reduceat makes the slowest part of a photograph.
        for further in range(1, self._state_count.max()):
            more = np.flatnonzero(self._state_count > further)
            of_cells[1 + more] += radiance_s[self._first_state[more] + further]
        return of_cells

    def _below(self, *, turned: bool) -> Phosphor:
        """Return the cells' states with their excitation below the LVF."""
        if turned not in self._below_lvf:
            assert self._lvf is not None
            passed = Lvf(self._lvf).below(self._lvf.on_sample, turned)[self._piece]
            self._below_lvf[turned] = replace(self.cells, excitation=self.cells.excitation * passed)
        return self._below_lvf[turned]


def in_table_scale(material: Material, irradiance: float) -> float:
    """Return the factor from a file's Λ to the room's radiance, 1 without a scale.

    Parameters
    ----------
    material
        Material of a sample.
    irradiance
        Irradiance of the warm lamp in multiples of the norm of a material's excitation rates.

    Raises
    ------
    UsageError
        Λ is absolute, and the file does not say how bright the lamp was.
    """
    if material.scale is None or material.bands_nm is None:
        return 1.0
    low_nm, high_nm = material.bands_nm[0], material.bands_nm[-1]
    inside = (low_nm < WAVELENGTH_NM) & (high_nm > WAVELENGTH_NM)
    # A diffuse white has the radiance E/π.
    lamp = np.pi * REFLECTED * irradiance * float(filament_spectrum(BURNING_K)[inside].mean())
    if material.scale == "relative":
        return lamp
    for factor in material.scale_factors:
        if factor.unit == IRRADIANCE_UNIT:
            return lamp / factor.value
    raise UsageError(
        f"{material.name}: expected the lamp's mean spectral irradiance among 'scale_factors' of a "
        f"material with 'scale: absolute' (unit: {IRRADIANCE_UNIT}), got none"
    )


def _refuse_two_laws(material: object, model: str) -> None:
    if isinstance(material, Material) and not material.is_first_order:
        raise UsageError(
            f"{material.name}: expected no 'model: {model}' in 'kinetics' of a material that has "
            "'kinetic_order', got both; leave one of them out"
        )
