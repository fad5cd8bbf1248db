"""Charged samples as the simulated lamp, a cooling filament, and phosphor make them.

The fit knows none of it: it is told when the lamp was switched, what irradiance each band has, and
how the lamp fades, band by band; not that the blue of a band fades before its red.
"""

import pickle
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.material import Material, read_material
from labrig.results import Charge, ChargingSeries, Transient
from labrig.sim.kinetics import KineticsSettings
from labrig.sim.lamp import BURNING_K, SETTLED_S, WAVELENGTH_NM, Lamp, filament_spectrum
from labrig.sim.phosphor import Phosphor, band_cells, phosphor
from labrig.sim.simulation import LampSettings

#: From lamp off until the door stands still.
DOOR_S = 0.6
RISE_S: FloatArray = np.linspace(0.0, 1.0, 33)
FADE_S: FloatArray = np.linspace(0.0, 0.5, 33)
STEADY = filament_spectrum(BURNING_K)
#: Channels relative to the brightest.
WEIGHTS: FloatArray = np.array([0.3, 1.0, 0.7])
#: Signal of a fully charged sample in the brightest channel.
FULL = 3000.0
#: Glow without noise by all that it follows from: many tests charge the same samples alike.
_GLOWS: dict[bytes, FloatArray] = {}


def lvf_windows(centres_nm: FloatArray, fwhm_nm: float = 25.0, peak: float = 0.45) -> FloatArray:
    """(P, n) what a linear variable filter lets through at each place; it leaks a little."""
    width = fwhm_nm / 2.3548
    line: FloatArray = np.exp(-0.5 * ((WAVELENGTH_NM - centres_nm[:, None]) / width) ** 2)
    return peak * line + 1e-4


#: Windows of a filter, and a sample without one.
LVF = lvf_windows(np.array([420.0, 450.0, 490.0, 540.0, 600.0, 670.0]))
BARE: FloatArray = np.ones((1, len(WAVELENGTH_NM)))


@dataclass
class Bench:
    """One material under one lamp.

    Attributes
    ----------
    material
        With excitation rates.
    irradiance
        Of the lamp, in multiples of the norm.
    flicker
        Of every photograph.
    lamp_scatter
        Relative error of the brightness of every charge as the fit is told it.
    photon
        Of a signal of 1.
    kinetics
        One trap of each state; its emission is the light of the state.
    """

    material: Material
    irradiance: float = 4.0
    flicker: float = 0.005
    lamp_scatter: float = 0.0
    read_noise: float = 0.3
    photons: float = 20.0
    lamp: LampSettings = field(default_factory=LampSettings)
    seed: int = 1
    kinetics: KineticsSettings | None = None

    def __post_init__(self) -> None:
        self.random = np.random.default_rng(self.seed)
        self.lamp_random = np.random.default_rng([self.seed, 1])

    def irradiances(self, windows: FloatArray) -> FloatArray:
        """(P, 8) E of the bands, as the material's norm has it."""
        assert self.material.bands_nm is not None
        assert self.material.irradiance_norm is not None
        cells = band_cells(self.material.bands_nm)
        scale = self.material.irradiance_norm.value / np.linalg.norm(cells @ STEADY)
        per_band: FloatArray = self.irradiance * scale * (windows * STEADY) @ cells.T
        return per_band

    def transient(self, on: bool) -> Transient:
        """Rise or fade as measured, band by band."""
        assert self.material.bands_nm is not None
        cells, t_s = band_cells(self.material.bands_nm), RISE_S if on else FADE_S
        steady = self.lamp.model_copy(update={"warm_up_deficit": 0.0})
        lamp = Lamp.found(steady, on=not on).switched(on, 0.0)
        light = np.array([cells @ lamp.irradiance(t) for t in t_s])
        return Transient.sampled(t_s, light / (cells @ STEADY))

    def series(
        self,
        name: str,
        windows: FloatArray,
        charge_durations_s: Sequence[float],
        wait_s: float = 300.0,
        shots: int = 12,
        every_s: float = 7.0,
        exposure_s: float = 0.5,
        lights: Sequence[int] | None = None,
    ) -> ChargingSeries:
        """Charges one after another, photographs after each, a wait in the dark before the next.

        With `lights`, one sample is charged through the window of that number, instead of samples
        behind all windows at once.
        """
        lamp, charges, at_s = Lamp.found(self.lamp, on=False), [], 10.0
        each_light: Sequence[int | None] = lights or [None] * len(charge_durations_s)
        for duration_s, light in zip(charge_durations_s, each_light, strict=True):
            off_s = at_s + duration_s
            start_s: FloatArray = off_s + DOOR_S + every_s * np.arange(float(shots))
            lamp = lamp.switched(True, at_s).switched(False, off_s)
            # as a photodiode shows it once the filament is hot: the housing warms slowly
            hot_s = at_s + RISE_S[-1]
            brightness = lamp.exposure(hot_s, off_s).sum() / STEADY.sum() / (off_s - hot_s)
            lasting = np.full(shots, exposure_s)
            seen = brightness * (1 + self.lamp_scatter * self.lamp_random.normal())
            charges.append(
                Charge(at_s, off_s, start_s, lasting, brightness=float(seen), light=light)
            )
            at_s = off_s + wait_s
        glow = self._glow(windows, lamp, charges)
        values = np.multiply.outer(glow, WEIGHTS)
        sigma = np.sqrt(self.read_noise**2 + values / (self.photons * exposure_s))
        values = values * (1 + self.flicker * self.random.normal(size=(len(values), 1, 1)))
        values = values + sigma * self.random.normal(size=values.shape)
        return ChargingSeries(
            name,
            tuple(charges),
            self.transient(on=True),
            self.transient(on=False),
            self.irradiances(windows),
            values,
            sigma,
        )

    def amplitudes(self) -> FloatArray:
        """(N,) signal of each state when fully charged."""
        rates = np.array([state.k_r_per_s for state in self.material.states])
        part = np.array([sum(state.reradiation or (1.0,)) for state in self.material.states])
        total: FloatArray = FULL * rates * part / (rates * part).sum()
        return total

    def level_at_off(self, windows: FloatArray, charge_s: float) -> FloatArray:
        """(N,) of the first place after one charge, traced back in the dark to lamp off."""
        lamp = Lamp.found(self.lamp, on=False).switched(True, 10.0)
        off_s = 10.0 + charge_s
        samples = self._samples(windows[:1])
        dark_s = off_s + SETTLED_S
        nothing = np.zeros(len(samples.k_r_per_s))
        level, _ = samples.evolve(nothing, 0.0, dark_s, lamp.switched(False, off_s))
        back: FloatArray = level * np.exp(samples.k_r_per_s * SETTLED_S)
        return back

    def _samples(self, windows: FloatArray) -> Phosphor:
        bare = phosphor([self.material], [None], self.irradiance, [self.kinetics])
        states, sites = len(bare.k_r_per_s), len(windows)
        each = np.tile(np.arange(states), sites)
        return Phosphor(
            np.tile(bare.k_r_per_s, sites),
            (windows[:, None, :] * bare.excitation).reshape(sites * states, -1),
            np.repeat(np.arange(sites), states),
            traps=None if bare.traps is None else bare.traps.of(each),
        )

    def _glow(self, windows: FloatArray, lamp: Lamp, charges: Sequence[Charge]) -> FloatArray:
        """(n, P) mean over each exposure."""
        seen = [(each.start_s, each.exposure_s, each.light) for each in charges]
        bench = (self.material, self.irradiance, self.kinetics)
        asked = pickle.dumps((bench, windows, lamp, seen))
        if asked not in _GLOWS:
            _GLOWS[asked] = self._followed(windows, lamp, charges)
        return _GLOWS[asked]

    def _followed(self, windows: FloatArray, lamp: Lamp, charges: Sequence[Charge]) -> FloatArray:
        """(n, P) mean over each exposure, step by step."""
        by_light = charges[0].light is not None
        each = [self._samples(windows[[light]]) for light in range(len(windows))]
        samples, sites = (each[0], 1) if by_light else (self._samples(windows), len(windows))
        level, since_s = np.zeros(len(samples.k_r_per_s)), 0.0
        found = []
        for charge in charges:
            samples = samples if charge.light is None else each[charge.light]
            for start_s, exposure_s in zip(charge.start_s, charge.exposure_s, strict=True):
                level, _ = samples.evolve(level, since_s, start_s, lamp)
                since_s = start_s + exposure_s
                level, collected = samples.evolve(level, start_s, since_s, lamp)
                mean = collected.reshape(sites, -1) / exposure_s
                found.append(mean @ self.amplitudes())
        return np.array(found)


def two_states() -> Material:
    """Two states that excite differently, both in Table 1's range."""
    blue = read_material("blue-paint")
    rates = {
        0.08: (0.06, 0.12, 0.02, 0.004, 0.001, 0.0, 0.0, 0.0),
        0.015: (0.02, 0.03, 0.01, 0.003, 0.0005, 0.0, 0.0, 0.0),
    }
    states = tuple(
        blue.states[0].model_copy(update={"k_r_per_s": k_r, "k_e_per_s": k_e})
        for k_r, k_e in rates.items()
    )
    return blue.model_copy(update={"name": "two states", "states": states})
