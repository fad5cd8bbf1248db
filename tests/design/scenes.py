"""Lights and materials of which designs are asked, and their glow by an independent integration."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp

from labrig.design import Keys, LightProgramme
from labrig.foundation.arrays import FloatArray


@dataclass(frozen=True)
class Truth:
    """A material by its numbers, states first."""

    k_r: FloatArray
    k_e: FloatArray
    reradiation: FloatArray
    albedo: FloatArray
    order: float = 1.0

    @classmethod
    def of(
        cls,
        k_r: ArrayLike,
        k_e: ArrayLike,
        reradiation: ArrayLike,
        albedo: ArrayLike,
        order: float = 1.0,
    ) -> "Truth":
        rates, excited, emitted, back = (
            np.array(each, dtype=np.float64) for each in (k_r, k_e, reradiation, albedo)
        )
        return cls(rates, excited, emitted, back, order)

    def radiance(self, light: LightProgramme, place: int, time_s: ArrayLike) -> FloatArray:
        """Radiance in the bands (n, bands), by a general solver of differential equations."""
        times = np.asarray(time_s, dtype=np.float64)
        level, done, found = np.zeros(len(self.k_r)), float(light.begin_s[0]), []
        for time in times.tolist():
            for end in [*(t for t in light.begin_s.tolist() if done < t < time), time]:
                level, done = self._after(light, place, level, done, end), end
            glow = (self.k_r * level**self.order) @ self.reradiation
            lit = light.irradiance[place][np.searchsorted(light.begin_s, time, "right") - 1]
            found.append(glow + self.albedo * lit / np.pi)
        return np.array(found)

    def _after(
        self, light: LightProgramme, place: int, level: FloatArray, begin: float, end: float
    ) -> FloatArray:
        if end <= begin:
            return level
        lit = light.irradiance[place][np.searchsorted(light.begin_s, begin, "right") - 1]
        kappa = self.k_e @ lit

        def slope(_: float, r: FloatArray) -> FloatArray:
            return np.asarray((1 - r) * kappa - self.k_r * np.maximum(r, 0) ** self.order)

        solved = solve_ivp(slope, (begin, end), level, method="LSODA", rtol=1e-9, atol=1e-12)
        return np.asarray(solved.y[:, -1])


#: Blue, green and red light in turn, each strong and weak, with darkness after each.
COLOURED = LightProgramme.checked(
    [0.0, 5.0, 25.0, 28.0, 60.0, 75.0, 120.0, 160.0],
    [
        [0.0, 0.0, 1.0],
        [0.0, 0.0, 0.0],
        [0.0, 3.0, 0.0],
        [0.0, 0.0, 0.0],
        [2.0, 0.0, 0.2],
        [0.0, 0.0, 0.0],
        [1.0, 1.0, 1.0],
        [0.0, 0.0, 0.0],
    ],
)
#: Times of keys, some in the light and most after it.
OFTEN_S = np.array(
    [
        2.0,
        5.5,
        10.0,
        20.0,
        26.0,
        28.5,
        35.0,
        50.0,
        70.0,
        76.0,
        90.0,
        110.0,
        140.0,
        161.0,
        180.0,
        240.0,
    ]
)


def keys_of(truth: Truth, light: LightProgramme, time_s: ArrayLike, place: int = 0) -> Keys:
    """Keys that a material meets."""
    return Keys.checked(place, time_s, truth.radiance(light, place, time_s))


def film(seed: int, frames: int = 200, n_keys: int = 4) -> tuple[LightProgramme, Keys]:
    """A light that differs in all frames of the first half, and keys that nobody could meet."""
    rng = np.random.default_rng(seed)
    irradiance = np.zeros((frames, 3))
    irradiance[: frames // 2] = rng.uniform(0, 1, (frames // 2, 3))
    light = LightProgramme.checked(np.arange(frames) * 0.125, irradiance)
    times = frames * 0.125 * np.linspace(0.15, 0.975, n_keys)
    fading = np.geomspace(1, 0.1, n_keys)[:, np.newaxis]
    return light, Keys.checked(0, times, rng.uniform(0, 1, (n_keys, 3)) * fading)
