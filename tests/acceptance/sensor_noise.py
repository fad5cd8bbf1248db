"""Read noise, gain and bend of made-up sensors by a camera calibration's frames.

    python -m tests.acceptance.sensor_noise [--seeds 100]

Frames are of 120 × 160 pixels under a colour filter, photons are Poisson's, the card is shaded by
20 % and flickers by 0.5 %. Three tables:

read noise: two pairs of dark frames, by the noise in steps of the camera's numbers and by where
black lies in a step: for all pixels in its middle, at a quarter, at its edge; spread normally by
0.25 or 0.6 steps, evenly over 6, by Laplace's law, or by columns on two levels, half a step apart.
Printed are the seeds of which a value is stated, its mean and σ, mean and rms of its errors in
σ; of the others, of which only a limit is stated, its mean and how often the noise is below it.

gain: six levels up to ¾ of white, of a sensor that loses the fraction at white (the signal is
bent by a parabola). Printed are gain and σ, mean and rms of its errors in σ, bend and σ, and the
gain by a straight line through the same variances. σ that would do if the sensor were known to be
straight is the last column.

coarse: a converter of 8 bits, whose photon noise is below half a step at the lower levels.
"""

import argparse
from collections.abc import Callable, Sequence

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.protocols.camera_calibration.analysis.linearity import Bend, fit_bend
from labrig.protocols.camera_calibration.analysis.photon_transfer import (
    Pair,
    measure_pair,
    photon_transfer,
)
from labrig.protocols.camera_calibration.result import PhotonTransfer
from labrig.reduce import RawFrame

SHAPE = 120, 160
WHOLE = (0.0, 0.0, 1.0, 1.0)
BLACK_DN = 1000.0
#: Light of the places of the colour filter.
COLOURS = np.tile([[0.6, 1.0], [1.0, 0.4]], (SHAPE[0] // 2, SHAPE[1] // 2))
SHADING = 1 - 0.2 * np.linspace(-1, 1, SHAPE[1]) ** 2
LEVELS: dict[str, Callable[[np.random.Generator], FloatArray]] = {
    "middle": lambda rng: np.zeros(SHAPE),
    "quarter": lambda rng: np.full(SHAPE, 0.25),
    "edge": lambda rng: np.full(SHAPE, 0.5),
    "normal 0.25": lambda rng: 0.1 + 0.25 * rng.standard_normal(SHAPE),
    "normal 0.6": lambda rng: 0.6 * rng.standard_normal(SHAPE),
    "even": lambda rng: rng.uniform(-3, 3, SHAPE),
    "Laplace 0.3": lambda rng: 0.1 + rng.laplace(0.0, 0.3 / np.sqrt(2), SHAPE),
    "columns": lambda rng: 0.1 + 0.5 * (np.arange(SHAPE[1]) % 2) * np.ones(SHAPE),
}
NOISES = 0.05, 0.1, 0.15, 0.2, 0.3, 0.5, 1.0, 3.0
BENDS = -0.05, -0.03, 0.0, 0.03, 0.05
FRACTIONS = np.linspace(0.03, 0.75, 6)


def raw(numbers: FloatArray) -> RawFrame:
    """Return a frame with a value in DN above black for each pixel, rounded."""
    mosaic = np.rint(BLACK_DN + numbers).astype(np.uint16)
    return RawFrame(mosaic, "RGGB", (BLACK_DN,) * 4, 60_000.0)


class Sensor:
    """A sensor with `gain` electrons a DN that loses the fraction `loss` at white."""

    def __init__(
        self, seed: int, gain: float, noise_dn: float, white_dn: float, loss: float, levels: str
    ) -> None:
        self.rng = np.random.default_rng(seed)
        self.gain, self.noise_dn, self.white_dn, self.loss = gain, noise_dn, white_dn, loss
        self.offsets = LEVELS[levels](self.rng)

    def frame(self, fraction: float) -> RawFrame:
        """Return a frame of the card at a fraction of white."""
        flicker = 1 + 0.005 * self.rng.standard_normal()
        light = fraction * self.white_dn * self.gain * flicker * COLOURS * SHADING
        signal = self.rng.poisson(light) / self.gain
        signal = signal * (1 - self.loss * signal / self.white_dn)
        return raw(signal + self.offsets + self.noise_dn * self.rng.standard_normal(SHAPE))

    def calibrated(self) -> tuple[PhotonTransfer, PhotonTransfer]:
        """Return the photon transfer, and that of a sensor which is known to be straight."""
        frames = [(self.frame(fraction), self.frame(fraction)) for fraction in FRACTIONS]
        darks = [(self.frame(0.0), self.frame(0.0)) for _ in range(2)]
        dark_dn = float(np.mean([one.mosaic - BLACK_DN for pair in darks for one in pair]))
        lit, dark = ([measured(*pair, dark_dn) for pair in pairs] for pairs in (frames, darks))
        pixels = [one.mosaic - BLACK_DN - dark_dn for pair in frames for one in pair]
        planes = [
            (each[::2, ::2], np.append(each[::2, 1::2], each[1::2, ::2]), each[1::2, 1::2])
            for each in pixels
        ]
        means = np.array([[plane.mean() for plane in each] for each in planes])
        variance = np.maximum(means, 0.0) / self.gain + self.noise_dn**2 + 1 / 12
        sigma = np.sqrt(variance / np.array([plane.size for plane in planes[0]]))
        bend = fit_bend(means, sigma, np.zeros(len(means), np.intp), self.white_dn)
        straight = Bend(np.zeros(2), 1e-12 * np.eye(2), self.white_dn)
        return photon_transfer(100, lit, dark, bend), photon_transfer(100, lit, dark, straight)


def measured(one: RawFrame, other: RawFrame, dark_dn: float = 0.0) -> Pair:
    """Return the pair of two frames whose dark level is `dark_dn` above black."""
    return measure_pair(one, other, WHOLE, dark_dn)


def pulls_text(values: Sequence[float], sigmas: Sequence[float], true: float) -> str:
    """Return mean, σ, and mean and rms of the errors in σ."""
    value, sigma = np.array(values), np.array(sigmas)
    pulls = (value - true) / sigma
    return (
        f"{value.mean():9.4f} ± {sigma.mean():.4f}, errors {pulls.mean():+.2f} σ, rms "
        f"{np.sqrt(np.square(pulls).mean()):.2f} σ"
    )


def read_noises(seeds: int) -> None:
    """Print the table of read noise."""
    # Bright light tells the gain, which is 1 electron a DN.
    bright = np.random.default_rng(0)
    lit = [
        measured(
            raw(bright.poisson(level, SHAPE).astype(float)),
            raw(bright.poisson(level, SHAPE).astype(float)),
        )
        for level in (4000, 8000, 12000)
    ]
    straight = Bend(np.zeros(2), 1e-12 * np.eye(2), 14_000.0)
    for noise_dn in NOISES:
        for name in LEVELS:
            stated, sigmas, limits = [], [], []
            for seed in range(seeds):
                rng = np.random.default_rng([seed, round(1000 * noise_dn), len(name)])
                offsets = LEVELS[name](rng)
                frames = [raw(offsets + noise_dn * rng.standard_normal(SHAPE)) for _ in range(4)]
                dark = [measured(frames[0], frames[1]), measured(frames[2], frames[3])]
                found = photon_transfer(100, lit, dark, straight).noise
                gain = found.gain_e_per_dn
                # The gain's own error is not the read noise's.
                by_gain = found.gain_e_per_dn_sigma / gain * found.read_noise_e
                sigma = np.sqrt(max(found.read_noise_e_sigma**2 - by_gain**2, 0.0)) / gain
                if found.read_noise_is_limit:
                    limits.append(found.read_noise_e / gain)
                else:
                    stated.append(found.read_noise_e / gain)
                    sigmas.append(sigma)
            texts = []
            if stated:
                texts.append(f"{len(stated)} stated: {pulls_text(stated, sigmas, noise_dn)}")
            if limits:
                below = sum(noise_dn <= limit for limit in limits)
                texts.append(f"{len(limits)} below {np.mean(limits):.3f}, {below} truly")
            print(f"noise {noise_dn:4g}, {name:11} {'; '.join(texts)}", flush=True)


def gains(seeds: int) -> None:
    """Print the table of gain and bend."""
    for loss in BENDS:
        bent, straight = zip(
            *(Sensor(seed, 4.0, 3.0, 14_000.0, loss, "normal 0.6").calibrated()
              for seed in range(seeds)), strict=True)  # fmt: skip
        gain = pulls_text(
            [each.noise.gain_e_per_dn for each in bent],
            [each.noise.gain_e_per_dn_sigma for each in bent],
            4.0,
        )
        line = [each.noise.gain_e_per_dn for each in straight]
        line_sigma = [each.noise.gain_e_per_dn_sigma for each in straight]
        values = np.array([(each.bend.value, each.bend.sigma) for each in bent])
        wide = [each.noise.gain_e_per_dn_sigma for each in bent]
        print(
            f"loss {100 * loss:+3g} % at white: gain {gain}; bend "
            f"{100 * values[:, 0].mean():+.2f} ± {100 * values[:, 1].mean():.2f} %; straight line "
            f"{np.mean(line):.4f} ± {np.mean(line_sigma):.4f}; σ {np.mean(wide):.4f}",
            flush=True,
        )


def coarse(seeds: int) -> None:
    """Print the table of a converter of 8 bits."""
    for gain in (50.0, 200.0):
        for name in ("normal 0.6", "middle", "edge"):
            found = [
                Sensor(seed, gain, 0.1, 230.0, 0.0, name).calibrated()[0].noise
                for seed in range(seeds)
            ]
            text = pulls_text(
                [each.gain_e_per_dn for each in found],
                [each.gain_e_per_dn_sigma for each in found],
                gain,
            )
            print(f"8 bits, {gain:g} e/DN, black {name:11} gain {text}", flush=True)


def main() -> None:
    """Print the three tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=100)
    asked = parser.parse_args()
    print(f"{asked.seeds} seeds")
    gains(asked.seeds)
    coarse(max(asked.seeds // 5, 1))
    read_noises(max(asked.seeds // 5, 1))


if __name__ == "__main__":
    main()
