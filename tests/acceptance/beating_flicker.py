"""Rates of decays whose light flickers periodically, with evenly and with randomly spaced frames.

    python -m tests.acceptance.beating_flicker [--seeds 40] [--exposure 0.63]

Decays of one state (k = 0.02 1/s) and of two (0.02 and 0.2 1/s, of equal amplitude) are recorded
every 5 s for 180 s in three channels, with independent noise of 0.1 % of the first value, a flicker
of 0.2 % that is independent from frame to frame, and a periodic one of 0.7 %: a sine of several
periods, and a square wave as of a heater that is switched. Each seed draws the phase, the noise and
the begins of the frames. The fit is the one of `labrig process` with the number of states given.

Printed are, in percent, how often a rate is wrong by more than 3 σ, and how often neither a warning
nor the statement on unseen flicker says a word then; how often a warning is given, how often one of
them says that residuals repeat, and how often the statement; the root mean square of
(fitted − true)/σ.
"""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import square

from labrig.fit import DecayFit, fit_decay
from labrig.protocols.steps.random_spacing import RandomSpacing
from tests.warned import codes

FIRST_S, EVERY_S, FRAMES = 0.5, 5.0, 36
#: Readout of the shipped camera, and the time that a protocol leaves for settings.
SPENT_S = 1.7
NOISE, FLICKER, RIPPLE = 1e-3, 2e-3, 7e-3
WEIGHTS = np.array([0.4, 1.0, 0.7])
STATES = {1: ((0.02,), (1.0,)), 2: ((0.2, 0.02), (0.5, 0.5))}
#: Points over which the light of an exposure is averaged.
POINTS = (np.arange(400) + 0.5) / 400
WRONG_SIGMAS = 3.0

Wave = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Flicker:
    """A periodic flicker, and its name."""

    name: str
    period_s: float
    wave: Wave
    ripple: float = RIPPLE


FLICKERS = (
    *(Flicker(f"sine {period:g} s", period, np.sin) for period in (5.1, 4.9, 2.55, 10.2, 7, 60)),
    Flicker("square 5.1 s", 5.1, square),
    Flicker("square 10.2 s", 10.2, square),
    Flicker("none", 1.0, np.sin, 0.0),
)


def fitted(
    n_states: int, flicker: Flicker, exposure_s: float, seed: int, *, is_random: bool
) -> DecayFit:
    """Return the fit of one decay."""
    rng = np.random.default_rng([seed, n_states, round(1000 * flicker.period_s)])
    t_s = (FIRST_S + EVERY_S * np.arange(FRAMES)).tolist()
    if is_random:
        spacing = RandomSpacing(EVERY_S, SPENT_S)
        t_s = spacing.begins_s(t_s, [exposure_s] * FRAMES, seed=int(rng.integers(2**32)))
    at_s = np.add.outer(t_s, exposure_s * POINTS)
    light = sum(a * np.exp(-k * at_s) for k, a in zip(*STATES[n_states], strict=True))
    phase = rng.uniform(0, 2 * np.pi)
    light *= 1 + flicker.ripple * flicker.wave(2 * np.pi * at_s / flicker.period_s + phase)
    frames = light.mean(axis=1) * (1 + FLICKER * rng.standard_normal(FRAMES))
    values = np.outer(frames, WEIGHTS)
    values += NOISE * rng.standard_normal(values.shape)
    return fit_decay(
        t_s,
        values,
        np.full_like(values, NOISE),
        exposure_s=exposure_s,
        channels=("R", "G", "B"),
        n_states=n_states,
        flicker=None,
    )


def line(n_states: int, fits: Sequence[DecayFit]) -> str:
    """Return the figures of fits of the same decay."""
    true = np.array(STATES[n_states][0])
    pulls = np.array(
        [[(s.k_r_per_s - k) / s.k_r_per_s_sigma for s, k in zip(fit.states, true, strict=True)]
         for fit in fits]
    )  # fmt: skip
    wrong = (np.abs(pulls) > WRONG_SIGMAS).any(axis=1)
    warned = np.array([bool(fit.warnings) for fit in fits])
    repeats = np.array(["residuals-periodic" in codes(fit.warnings) for fit in fits])
    unseen = np.array([fit.unseen_flicker is not None for fit in fits])
    rms = np.sqrt((pulls**2).mean())
    shares = (wrong, wrong & ~warned & ~unseen, warned, repeats, unseen)
    numbers = (100 * share.mean() for share in shares)
    return "   ".join(f"{number:5.1f}" for number in numbers) + f"  {rms:5.2f}"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=40)
    parser.add_argument("--exposure", type=float, default=0.63)
    arguments = parser.parse_args()
    print(f"{arguments.seeds} decays a line, exposures of {arguments.exposure:g} s")
    print("states  spacing  flicker        wrong  silent  warned  repeats  unseen  rms pull")
    for n_states in STATES:
        for is_random in (False, True):
            for flicker in FLICKERS:
                fits = [
                    fitted(n_states, flicker, arguments.exposure, seed, is_random=is_random)
                    for seed in range(arguments.seeds)
                ]
                spacing = "random" if is_random else "even"
                print(
                    f"{n_states:<6}  {spacing:<7}  {flicker.name:<13}  {line(n_states, fits)}",
                    flush=True,
                )


if __name__ == "__main__":
    main()
