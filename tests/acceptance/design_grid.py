"""A design's solver against the grid search of Nalbach et al., section 6.

    python -m tests.acceptance.design_grid [--targets N] [--values N]

Six random targets of four keys in 200 frames, three bands, one state of the first order. Three ways
minimise the same sum of squares with the same exact steps, one after another in one process:

- the grid of 10 values in each of seven dimensions (Λ and k_e of three bands, k_r), every candidate
  integrated for itself, as on the paper's graphics card;
- the grid of 10⁴ rates, Λ and albedo eliminated by bounded least squares;
- labrig's solver.

The albedo is given, since the paper's seven dimensions have none. The paper's ranges are in its
supplemental; here they cover, in steps of equal ratio, what can be told apart in 25 s.
"""

import argparse
import time
from functools import partial
from itertools import product

import numpy as np

from labrig.design import Keys, LightProgramme, solve, three_bands
from labrig.foundation.arrays import FloatArray
from tests.design.scenes import film

#: Ranges of k_e per unit of light, of k_r in 1/s, and of Λ k_r in units of the brightest key.
K_E, K_R, LAMBDA_K_R = (0.003, 3.0), (0.02, 10.0), (0.03, 30.0)
ALBEDO = 0.3
CHUNK = 20_000


def levels(light: LightProgramme, keys: Keys, k_e: FloatArray, k_r: FloatArray) -> FloatArray:
    """Levels at the keys (n, keys) of candidates k_e (n, 3) and k_r (n,), frame by frame."""
    frame_s = float(light.begin_s[1])
    r = np.zeros(len(k_r))
    found = np.empty((len(k_r), keys.count))
    for frame, irradiance in enumerate(light.irradiance[0]):
        begin = frame * frame_s
        for number, key_s in enumerate(keys.time_s):
            if begin <= key_s < begin + frame_s:
                found[:, number] = step(r, k_e @ irradiance, k_r, key_s - begin)
        r = step(r, k_e @ irradiance, k_r, frame_s)
    return found


def step(r: FloatArray, kappa: FloatArray, k_r: FloatArray, duration_s: float) -> FloatArray:
    """The exact step of constant light."""
    rate = kappa + k_r
    steady = kappa / rate
    return np.asarray(steady + (r - steady) * np.exp(-rate * duration_s))


def whole_grid(light: LightProgramme, keys: Keys, weight: FloatArray, values: int) -> float:
    """Least sum of squares of all candidates, each integrated for itself."""
    wanted = keys.radiance - ALBEDO * light.at(keys.place, keys.time_s) / np.pi
    k_e, k_r = np.geomspace(*K_E, values), np.geomspace(*K_R, values)
    emitted = np.geomspace(*LAMBDA_K_R, values) * keys.radiance.max()
    least = np.inf
    shape = (values,) * 7
    for first in range(0, values**7, CHUNK):
        index = np.unravel_index(np.arange(first, min(first + CHUNK, values**7)), shape)
        level = levels(light, keys, np.stack([k_e[i] for i in index[:3]], axis=1), k_r[index[3]])
        cost = np.zeros(len(level))
        for band in range(3):
            got = emitted[index[4 + band]][:, np.newaxis] * level
            cost += ((weight * (got - wanted[:, band])) ** 2).sum(axis=1)
        least = min(least, float(cost.min()))
    return least


def eliminated_grid(light: LightProgramme, keys: Keys, weight: FloatArray, values: int) -> float:
    """Least sum of squares of a grid of rates, each with its best Λ ≥ 0."""
    wanted = keys.radiance - ALBEDO * light.at(keys.place, keys.time_s) / np.pi
    axes = [np.geomspace(*K_E, values)] * 3 + [np.geomspace(*K_R, values)]
    rates = np.array(list(product(*axes)))
    glow = weight * levels(light, keys, rates[:, :3], rates[:, 3])
    target = weight[:, np.newaxis] * wanted
    square = (glow**2).sum(axis=1)
    fitted = np.maximum(glow @ target, 0) / np.maximum(square, 1e-300)[:, np.newaxis]
    missed = np.einsum("nk,nb->nkb", glow, fitted) - target
    return float((missed**2).sum(axis=(1, 2)).min())


def solved(light: LightProgramme, keys: Keys) -> float:
    """Sum of squares that labrig reaches."""
    return solve(light, keys, three_bands(), albedo=ALBEDO).cost


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--targets", type=int, default=6)
    parser.add_argument("--values", type=int, default=10, help="values in each dimension")
    arguments = parser.parse_args()
    bands, values = three_bands(), arguments.values
    print(f"          {values}^7 candidates         {values}^4, Λ eliminated      labrig")
    print("target    cost        time / s     cost        time / ms     cost        time / ms   ×")
    light, keys = film(99)
    solved(light, keys)  # imports
    for seed in range(arguments.targets):
        light, keys = film(seed)
        weight = 1 / keys.luminance(bands)
        row, times = [], []
        for search in (
            partial(whole_grid, light, keys, weight, values),
            partial(eliminated_grid, light, keys, weight, values),
            partial(solved, light, keys),
        ):
            begin = time.perf_counter()
            row.append(search())
            times.append(time.perf_counter() - begin)
        print(
            f"{seed:6d} {row[0]:11.5f} {times[0]:11.2f} {row[1]:13.5f} {1e3 * times[1]:11.1f} "
            f"{row[2]:13.5f} {1e3 * times[2]:11.1f} {times[0] / times[2]:8.0f}"
            + ("" if row[2] <= min(row[:2]) * (1 + 1e-9) else "   HIGHER"),
            flush=True,
        )


if __name__ == "__main__":
    main()
