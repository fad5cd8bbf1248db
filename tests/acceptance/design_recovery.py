"""The materials of Table 1 are recovered from their own glow.

    python -m tests.acceptance.design_recovery [--seeds N] [--sigma 0.01]

Every shipped material of one or two states whose rates are known in bands is lit band after band
and by all of them, and its glow is given as spectra with noise of 1 % of each key's luminance.
Counted are the parameters that the solver calls determined, those of them farther than 3 σ from
the truth, the root mean square of their pulls, and the largest pull. The glow is integrated by a
general solver of differential equations.
"""

import argparse
import time

import numpy as np

from labrig.design import Design, Keys, LightProgramme, presets, solve, spectral_bands
from labrig.material import Material
from tests.design.scenes import Truth

BRIGHT = 3.0
ALBEDO = 0.4
#: Light of each band for 40 s, with 80 s of darkness after it; then all bands at once.
LIT_S, DARK_S = 40.0, 80.0
KEYS_S = (20.0, 42.0, 55.0, 75.0, 110.0)
#: Largest glow over that of a white card under a band's light, so that the albedo is seen, too.
GLOW = 0.3


def programme(n_bands: int) -> LightProgramme:
    """The light of each band in turn, and of all."""
    rows: list[np.ndarray] = []
    for band in range(n_bands + 1):
        light = np.zeros(n_bands)
        light[band if band < n_bands else slice(None)] = BRIGHT
        rows += [light, np.zeros(n_bands)]
    begin = np.arange(len(rows) // 2) * (LIT_S + DARK_S)
    return LightProgramme.checked(np.column_stack([begin, begin + LIT_S]).ravel(), rows)


def recovered(material: Material, seed: int, sigma: float) -> list[tuple[str, float, bool]]:
    """Pull of each parameter, and whether it is said to be determined."""
    bands = spectral_bands(material.bands_nm or ())
    light = programme(bands.count)
    states = sorted(material.states, key=lambda state: -state.k_r_per_s)
    emitted = np.array([state.reradiation or () for state in states])
    truth = Truth.of(
        [state.k_r_per_s for state in states],
        [state.k_e_per_s or () for state in states],
        emitted,
        np.full(bands.count, ALBEDO),
    )
    times = np.add.outer(light.begin_s[::2], KEYS_S).ravel()
    glow = truth.radiance(light, 0, times)
    dark = np.arange(len(times)) % len(KEYS_S) > 0
    factor = GLOW * BRIGHT / float(glow[dark].max())
    truth = Truth(truth.k_r, truth.k_e, factor * emitted, truth.albedo)
    exact = Keys.checked(0, times, truth.radiance(light, 0, times))
    rng = np.random.default_rng([seed, *material.name.encode()])
    noise = sigma * exact.luminance(bands)[:, np.newaxis] * rng.normal(size=exact.radiance.shape)
    keys = Keys(exact.place, exact.time_s, exact.radiance + noise)
    return pulls(solve(light, keys, bands, n_states=len(states), key_sigma=sigma), truth)


def pulls(design: Design, truth: Truth) -> list[tuple[str, float, bool]]:
    """Compare each estimate with the truth of the same name."""
    many = design.n_states > 1
    truths: dict[str, float] = {}
    for state in range(design.n_states):
        label = f" {state + 1}" if many else ""
        truths[f"k_r{label}"] = truth.k_r[state]
        for band, name in enumerate(design.bands.names):
            truths[f"k_e{label} {name}"] = truth.k_e[state, band]
            truths[f"Λ{label} {name}"] = truth.reradiation[state, band]
    truths |= {f"albedo {n}": a for n, a in zip(design.bands.names, truth.albedo, strict=True)}
    return [
        (each.name, (each.value - truths[each.name]) / each.sigma, each.is_determined)
        for each in design.estimates
    ]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--sigma", type=float, default=0.01)
    arguments = parser.parse_args()
    print("material               states  parameters  determined  beyond 3 σ   rms  largest    s")
    total, beyond, squares = 0, 0, 0.0
    for material in presets():
        if len(material.states) > 2:
            continue
        begin = time.perf_counter()
        found = [
            each
            for seed in range(arguments.seeds)
            for each in recovered(material, seed, arguments.sigma)
        ]
        known = np.array([pull for _, pull, is_known in found if is_known])
        far = int((np.abs(known) > 3).sum())
        total, beyond, squares = total + len(known), beyond + far, squares + float((known**2).sum())
        print(
            f"{material.name:22} {len(material.states):6} {len(found):11} {len(known):11} {far:11} "
            f"{np.sqrt((known**2).mean()):6.2f} {np.abs(known).max():8.2f} "
            f"{(time.perf_counter() - begin) / arguments.seeds:5.2f}",
            flush=True,
        )
    print(f"beyond 3 σ: {beyond} of {total}; rms {np.sqrt(squares / total):.3f}")


if __name__ == "__main__":
    main()
