"""Errors of spectra from one picture through a variable filter, and coverage of their bands.

    python -m tests.acceptance.spectrum_through_lvf [count]

Two tables. How often the truth lies in the credible band of every 10 nm, over all bands and over
those above 2 % of the peak, for lights of three kinds, seen with the curves that the fit has or
with those of another laboratory. And CIEDE2000 of the ColorChecker under a halogen lamp for the 2°
observer of 1931, all patches scaled by one factor that makes white's Y right; white is the lamp
itself, or the lamp as measured through the filter, too. With another laboratory's curves the fit
allows for their errors and has a picture of a grey card under the lamp, as `emission_spectrum` by
default; or it has no such picture (`white: false`); or it takes the curves for exact.
"""

import sys
from collections.abc import Sequence

import colour
import numpy as np

from labrig.analyse.forward_model import conditioned_on_white
from labrig.fit.spectrum import (
    CurveError,
    SpectralSystem,
    fit_spectrum,
    system_through_lvf,
)
from labrig.foundation.arrays import FloatArray
from labrig.optics import CameraResponse, Lvf, Spectrum, signal_through
from labrig.optics.piecewise import band_means
from tests.fit import lvf_pictures as made

LEVELS = (0.6827, 0.95)
BRIGHT = 0.02


def coverage(
    lights: Sequence[Spectrum], camera: CameraResponse, system: SpectralSystem, lvf: Lvf
) -> tuple[FloatArray, FloatArray]:
    """Shares of bands within each level, of all and of the bright ones; the scale is left free."""
    inside, bright = [], []
    for number, light in enumerate(lights):
        picture = made.photographed(light, lvf, camera, np.random.default_rng(number))
        fit = fit_spectrum(picture.value, picture.sigma, system)
        truth = light.in_bands(made.EDGES_NM)
        draws = band_means(fit.knots_nm, fit.samples.T, made.EDGES_NM)
        draws = draws / draws.sum(axis=0) * truth.sum()
        bright.append(truth > BRIGHT * truth.max())
        ends = [np.quantile(draws, [(1 - p) / 2, (1 + p) / 2], axis=1) for p in LEVELS]
        inside.append([(low <= truth) & (truth <= high) for low, high in ends])
    within, chosen = np.array(inside), np.array(bright)
    return within.mean(axis=(0, 2)), within.swapaxes(1, 2)[chosen].mean(axis=0)


def colour_errors(
    camera: CameraResponse, system: SpectralSystem, lvf: Lvf, snr: float = 300.0
) -> dict[str, FloatArray]:
    """CIEDE2000 of the 24 patches by what is taken for white."""
    lamp = made.halogen_lamp()
    observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    fine = np.arange(400.0, 700.1, 1.0)
    matching = np.stack([np.interp(fine, observer.wavelengths, v) for v in observer.values.T])
    rng = np.random.default_rng(0)

    def true_xyz(light: Spectrum) -> FloatArray:
        xyz: FloatArray = matching @ light.at(fine)
        return xyz

    def measured_xyz(light: Spectrum) -> FloatArray:
        picture = made.photographed(light, lvf, camera, rng, snr)
        fit = fit_spectrum(picture.value, picture.sigma, system)
        xyz: FloatArray = matching @ np.interp(fine, fit.knots_nm, fit.value)
        return xyz

    def lab(xyz: FloatArray, white: FloatArray) -> FloatArray:
        return np.asarray(colour.XYZ_to_Lab(xyz / white[1], colour.XYZ_to_xy(white)))

    white, measured_white = true_xyz(lamp), measured_xyz(lamp)
    patches = made.colour_checker(lamp)
    true = np.array([lab(true_xyz(patch), white) for patch in patches])
    measured = [measured_xyz(patch) for patch in patches]
    as_true = np.array([lab(xyz / measured_white[1] * white[1], white) for xyz in measured])
    as_measured = np.array([lab(xyz, measured_white) for xyz in measured])
    return {
        "the lamp": np.asarray(colour.delta_E(as_true, true, method="CIE 2000")),
        "the lamp as measured": np.asarray(colour.delta_E(as_measured, true, method="CIE 2000")),
    }


def main(count: int) -> None:
    """Print both tables."""
    lvf, ours, theirs = made.curved_lvf(), made.of_the_house(), made.of_another_laboratory()
    exact = system_through_lvf(lvf, ours, made.KNOTS_NM)
    unsure = system_through_lvf(lvf, ours, made.KNOTS_NM, CurveError())
    lamp = made.halogen_lamp()
    card = made.photographed(lamp, lvf, theirs, np.random.default_rng(1))
    expected = signal_through(lvf, ours, lamp).ravel()
    default = conditioned_on_white(unsure, card.value, card.sigma, lamp, expected)
    kinds = {
        "fluorophores": made.fluorophores(count),
        "LEDs": made.narrow_leds(count),
        "mercury lines": [made.mercury_lamp(np.random.default_rng(k)) for k in range(count)],
    }
    cases = [
        ("same curves", ours, exact),
        ("another's, grey card", theirs, default),
        ("another's, no card", theirs, unsure),
    ]
    print(f"{'light':15s}{'camera':22s}{'68 %':>7s}{'95 %':>7s}   bright: 68 %   95 %")
    for kind, lights in kinds.items():
        for name, camera, system in cases:
            every, bright = coverage(lights, camera, system, lvf)
            print(
                f"{kind:15s}{name:22s}{every[0]:7.1%}{every[1]:7.1%}"
                f"        {bright[0]:7.1%}{bright[1]:7.1%}",
                flush=True,
            )
    print(f"\n{'ColorChecker, halogen: camera':32s}{'white':22s}  mean   95 %    max")
    for name, camera, system in [*cases, ("another's, taken for exact", theirs, exact)]:
        for white, errors in colour_errors(camera, system, lvf).items():
            print(
                f"{name:32s}{white:22s}{errors.mean():6.2f}{np.percentile(errors, 95):7.2f}"
                f"{errors.max():7.2f}",
                flush=True,
            )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 40)
