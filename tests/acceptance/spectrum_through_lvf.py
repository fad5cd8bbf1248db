"""Errors of spectra from one picture through a variable filter, and coverage of their bands.

    python -m tests.acceptance.spectrum_through_lvf [count]

Three tables. How often the truth lies in the credible band of every 10 nm, over all bands and over
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

from labrig.analyse.emission_spectrum.forward_model import conditioned_on_white
from labrig.fit.least_squares import FloatArray
from labrig.fit.spectrum import (
    CurveError,
    SpectralSystem,
    fit_spectrum,
    system_through_lvf,
)
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


FINE_NM: FloatArray = np.arange(380.0, 720.1, 0.25)
TB_NM = (487, 493, 542, 548, 583, 588, 619, 624)
EU_NM = (591, 596, 611, 617, 624, 651, 656, 688, 698, 704)


def _peak(centre_nm: float, fwhm_nm: float) -> FloatArray:
    shape: FloatArray = np.exp(-np.log(16) * ((FINE_NM - centre_nm) / fwhm_nm) ** 2)
    return shape


def _rare_earth(
    rng: np.random.Generator, nm: Sequence[float], heights: Sequence[float]
) -> FloatArray:
    """Lines of 4 to 7 nm about the given places, of about the given heights."""
    total = np.zeros_like(FINE_NM)
    for place, height in zip(nm, heights, strict=True):
        total += height * rng.uniform(0.6, 1.4) * _peak(place + rng.normal(), rng.uniform(4, 7))
    return total


def narrow_light(kind: str, rng: np.random.Generator) -> Spectrum:
    """A light of a kind, its places and widths drawn."""
    place_nm = float(rng.uniform(430, 650))
    match kind.split():
        case ["band", low, high]:
            value = _peak(place_nm, float(rng.uniform(float(low), float(high))))
        case ["line", fwhm]:
            value = _peak(place_nm, float(fwhm))
        case ["line", fwhm, "on", "a", "band"]:
            value = _peak(float(rng.uniform(480, 600)), float(rng.uniform(60, 120)))
            value = value + rng.uniform(0.5, 3) * _peak(place_nm, float(fwhm))
        case ["two", fwhm, apart]:
            value = _peak(place_nm, float(fwhm))
            value = value + rng.uniform(0.3, 1) * _peak(place_nm + float(apart), float(fwhm))
        case ["Lorentzian", fwhm]:
            value = 1 / (1 + ((FINE_NM - place_nm) / (float(fwhm) / 2)) ** 2)
        case ["Tb"]:
            value = _rare_earth(rng, TB_NM, (0.3, 0.25, 1, 0.8, 0.2, 0.2, 0.12, 0.08))
        case _:
            value = _rare_earth(rng, EU_NM, (0.4, 0.3, 1, 0.6, 0.3, 0.1, 0.08, 0.2, 0.5, 0.5))
    return Spectrum(kind, FINE_NM, value)


NARROW = (
    "band 40 120", "line 5", "line 8", "line 15", "line 25", "line 5 on a band",
    "line 8 on a band", "line 15 on a band", "two 5 5", "two 5 10", "two 5 20", "Lorentzian 5",
    "Tb", "Eu",
)  # fmt: skip


def narrow_lights(count: int, kinds: Sequence[str] = NARROW) -> None:
    """Print the table of narrow lights."""
    lvf, camera = made.curved_lvf(), made.of_the_house()
    system = system_through_lvf(lvf, camera, made.KNOTS_NM)
    print(
        f"\n{'light, FWHM / nm':20s}{'rms/σ':>7s}{'max/σ':>7s}{'50 nm':>7s}{'error':>8s}"
        f"{'lines':>8s}"
    )
    for kind in kinds:
        bands, sums, errors, with_lines = [], [], [], 0
        for number in range(count):
            rng = np.random.default_rng(number)
            light = narrow_light(kind, rng)
            picture = made.photographed(light, lvf, camera, rng)
            fit = fit_spectrum(picture.value, picture.sigma, system)
            with_lines += bool(fit.lines)
            true = light.in_bands(made.EDGES_NM)
            draws = band_means(fit.knots_nm, fit.samples.T, made.EDGES_NM)
            difference, covariance = draws.mean(axis=1) - true, np.cov(draws)
            bright = true > BRIGHT * true.max()
            bands.append(difference[bright] / np.sqrt(np.diag(covariance)[bright]))
            errors.append(difference[bright] / true.max())
            window = np.abs(made.GRID_NM - made.GRID_NM[np.argmax(true)]) <= 20
            sums.append(
                difference[window].sum() / np.sqrt(covariance[np.ix_(window, window)].sum())
            )
        rms_band, rms_sum, rms_error = (
            float(np.sqrt(np.mean(np.square(one))))
            for one in (np.concatenate(bands), np.array(sums), np.concatenate(errors))
        )
        print(
            f"{kind:20s}{rms_band:7.2f}{np.abs(np.concatenate(bands)).max():7.1f}{rms_sum:7.2f}"
            f"{rms_error:8.2%}{with_lines:5d}/{count}",
            flush=True,
        )


def main(count: int) -> None:
    """Print the tables."""
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
    narrow_lights(count)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 40)
