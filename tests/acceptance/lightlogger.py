"""A real sensor with 18 channels reads narrow-band light: its peaks, found by labrig's fits.

    python -m tests.acceptance.lightlogger

The channels' sensitivities are fitted on some of the wavelengths at full intensity, from what a
spectroradiometer saw; then the wavelengths held out, at four intensities, are told from the 18
readings alone: as the centre of a line as wide as those it was trained on (`fit_line`), and, for
comparison, as the highest peak of a spectrum that need only be smooth (`fit_spectrum`). Every third
wavelength is held out, three times, so that all are once; every second, twice; and a third of them
at random, five times. Printed: how far each peak is off the spectroradiometer's, what σ the fit
states, and what σ noise alone would leave if the sensitivities were known.
"""

import csv
import math
from dataclasses import dataclass

import numpy as np

from labrig.fit.spectrum import LineFit, SpectralSystem, fit_line, fit_spectrum
from labrig.foundation.arrays import FloatArray
from labrig.optics import Spectrum, read_curve_file
from labrig.optics.piecewise import hat_functions, quadrature
from tests.real_data import REAL

FOLDER = REAL / "lightlogger"
INTENSITIES_PCT = (5, 30, 90, 100)
TRAINED_PCT = 100
KNOTS_NM = np.arange(370.0, 791.0, 5.0)
#: Amplification by what the sensor calls its gain.
GAINS = {"2": 1.0, "3": 4.0}
DARK_PERCENTILE = 20
#: Where the sensor has channels on both sides of the light.
SEEN_NM = (400.0, 700.0)
#: Readings are whole numbers, repeatable to about this share.
RELATIVE_SIGMA = 0.01
#: Of the channel's highest reading, when its sensitivity is fitted.
MIN_FRACTION = 0.002
#: Ways in which a fitted sensitivity may be wrong that are kept of its samples.
UNSURE = 6
MIN_SIGMA = 0.001
#: Fraction of the brightest channel that others see of light which is not theirs.
CROSSTALK = 0.005


@dataclass(frozen=True, eq=False)
class Setting:
    """Narrow-band light, what the spectroradiometer saw of it, and the sensor's readings (18,)."""

    nominal_nm: int
    light: Spectrum
    reading: FloatArray

    @property
    def sigma(self) -> FloatArray:
        crosstalk = np.hypot(CROSSTALK * self.reading.max(), MIN_SIGMA)
        sigma: FloatArray = np.hypot(RELATIVE_SIGMA * self.reading, crosstalk)
        return sigma


def settings(percent: int) -> list[Setting]:
    """All wavelengths at one intensity; gain and integration time divided out, dark taken off."""
    lights = read_curve_file(FOLDER / f"jeti_irradiance_{percent}pct.csv").curves
    with (FOLDER / f"spectral_sensor_{percent}pct.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    rates = np.array([_counts_per_step(row) for row in rows])
    gains = np.array([GAINS[row["VISgain"]] for row in rows])
    # What no light causes is not amplified like light: dark is taken off gain by gain.
    for gain in set(gains.tolist()):
        of_gain = gains == gain
        rates[of_gain] -= np.percentile(rates[of_gain], DARK_PERCENTILE, axis=0)
    readings = rates / gains[:, np.newaxis]
    return [
        Setting(
            int(row["input_wavelength"]),
            Spectrum(name, *lights[name]),
            np.maximum(reading, 0.0),
        )
        for row, reading in zip(rows, readings, strict=True)
        for name in [f"{row['input_wavelength']}nm"]
    ]


def _counts_per_step(row: dict[str, str]) -> FloatArray:
    steps = float(row["VISintegrationtime"]) + 1
    return np.array([float(row[f"c_CH{k}"]) for k in range(1, 19)]) / steps


def sensor(trained: list[Setting]) -> SpectralSystem:
    """Its channels' sensitivities, each fitted like a spectrum: the lights are its design."""
    lights = np.stack([_in_knots(setting.light) for setting in trained])
    design, modes = [], []
    for channel in range(18):
        readings = np.array([setting.reading[channel] for setting in trained])
        sigma = np.hypot(RELATIVE_SIGMA * readings, MIN_FRACTION * readings.max())
        fit = fit_spectrum(readings, sigma, SpectralSystem(KNOTS_NM, lights), decisive=math.inf)
        design.append(_in_knots(Spectrum("channel", KNOTS_NM, fit.value)))
        deviation = (fit.samples - fit.value) / np.sqrt(len(fit.samples))
        _, strength, direction = np.linalg.svd(deviation, full_matrices=False)
        for component in strength[:UNSURE, np.newaxis] * direction[:UNSURE]:
            mode = np.zeros((18, len(KNOTS_NM)))
            mode[channel] = _in_knots(Spectrum("mode", KNOTS_NM, component))
            modes.append(mode)
    return SpectralSystem(KNOTS_NM, np.stack(design), np.array(modes))


def _in_knots(light: Spectrum) -> FloatArray:
    """∫ light · tent dλ for every knot."""
    nodes, weights = quadrature(KNOTS_NM[0], KNOTS_NM[-1], light.wavelength_nm, KNOTS_NM)
    result: FloatArray = (weights * light.at(nodes)) @ hat_functions(KNOTS_NM, nodes)
    return result


def peak_nm(light: Spectrum) -> float:
    """Centre of gravity of what is above half of the highest peak, without other peaks."""
    fine = np.arange(370.0, 790.0, 0.5)
    value = light.at(fine)
    top = int(value.argmax())
    low = np.flatnonzero(value[:top] <= value[top] / 2)
    high = np.flatnonzero(value[top:] <= value[top] / 2)
    peak = slice(low[-1] + 1 if low.size else 0, top + high[0] if high.size else len(fine))
    return float((fine[peak] * value[peak]).sum() / value[peak].sum())


def fwhm_nm(light: Spectrum) -> float:
    """Wavelengths above half of the highest."""
    fine = np.arange(370.0, 790.0, 0.1)
    value = light.at(fine)
    return 0.1 * float(np.count_nonzero(value > value.max() / 2))


@dataclass(frozen=True)
class Told:
    """A peak that was held out.

    Attributes
    ----------
    nominal_nm, percent
        What was set.
    error_nm
        `line`'s centre minus the measured peak.
    line
        What was found.
    noise_sigma_nm, smooth_error_nm
        For comparison: σ if the sensitivities were exact, and the error of the highest peak of a
        smooth spectrum; NaN where not wanted.
    """

    nominal_nm: int
    percent: int
    error_nm: float
    line: LineFit
    noise_sigma_nm: float
    smooth_error_nm: float


def told(held_out: set[int], percents: tuple[int, ...], compared: bool = False) -> list[Told]:
    """All peaks held out where the sensor sees, found without them.

    Parameters
    ----------
    held_out
        Nominal wavelengths.
    percents
        Intensities; trained is at `TRAINED_PCT`.
    compared
        Whether to fit what it is compared with, too.
    """
    trained = [s for s in settings(TRAINED_PCT) if s.nominal_nm not in held_out]
    system, found = sensor(trained), []
    exact = SpectralSystem(system.knots_nm, system.design)
    width_nm = float(np.median([fwhm_nm(setting.light) for setting in trained]))
    for percent in percents:
        for setting in settings(percent):
            nm, reading, sigma = setting.nominal_nm, setting.reading, setting.sigma
            if nm not in held_out or not SEEN_NM[0] <= nm <= SEEN_NM[1]:
                continue
            true_nm, noise_nm, smooth_nm = peak_nm(setting.light), np.nan, np.nan
            line = fit_line(reading, sigma, system, width_nm)
            if compared:
                known = fit_line(reading, sigma, exact, width_nm)
                noise_nm = known.sigma_nm / max(1.0, known.misfit)
                smooth = fit_spectrum(reading, sigma, system, samples=100)
                smooth_nm = peak_nm(Spectrum("estimate", smooth.knots_nm, smooth.value))
            error_nm = line.wavelength_nm - true_nm
            found.append(Told(nm, percent, error_nm, line, noise_nm, smooth_nm - true_nm))
    return found


def every(number: int) -> list[set[int]]:
    """Wavelengths held out in turn, every second or third."""
    return [set(range(first, 781, 10 * number)) for first in range(380, 380 + 10 * number, 10)]


def at_random(times: int) -> list[set[int]]:
    """A third of the wavelengths, drawn anew each time."""
    rng = np.random.default_rng(0)
    every_nm = np.arange(380, 781, 10)
    return [set(rng.choice(every_nm, 14, replace=False).tolist()) for _ in range(times)]


def _distribution(name: str, errors_nm: list[float]) -> None:
    marks = np.percentile(np.abs(errors_nm), [25, 50, 75, 90, 100])
    print(f"{name:<34}{len(errors_nm):>5}" + "".join(f"{mark:>7.1f}" for mark in marks))


def main() -> None:
    """Print errors by wavelength and intensity, and their distributions."""
    thirds = [one for nm in every(3) for one in told(nm, INTENSITIES_PCT, compared=True)]
    errors = {(one.nominal_nm, one.percent): one.error_nm for one in thirds}
    print("held out   " + "".join(f"{percent:8d} %" for percent in INTENSITIES_PCT))
    for nm in sorted({nm for nm, _ in errors}):
        row = "".join(f"{errors[nm, percent]:+9.1f} " for percent in INTENSITIES_PCT)
        print(f"{nm:6d} nm  {row}")
    print(f"\n{'|peak error| in nm':<34}{'n':>5}   25 %   50 %   75 %   90 %  worst")
    _distribution("every third held out", [one.error_nm for one in thirds])
    _distribution("  peak of a smooth spectrum", [one.smooth_error_nm for one in thirds])
    halves = [one for held_out in every(2) for one in told(held_out, INTENSITIES_PCT)]
    _distribution("every second held out", [one.error_nm for one in halves])
    drawn = [one for held_out in at_random(5) for one in told(held_out, INTENSITIES_PCT)]
    _distribution("a third at random held out", [one.error_nm for one in drawn])
    over_sigma = np.array([one.error_nm / one.line.sigma_nm for one in thirds])
    stated = np.median([one.line.sigma_nm for one in thirds])
    noise = np.median([one.noise_sigma_nm for one in thirds])
    print(
        f"\nσ stated {stated:.2f} nm (median), of noise alone {noise:.2f} nm; rms of error over σ "
        f"{np.sqrt(np.mean(over_sigma**2)):.1f}"
    )


if __name__ == "__main__":
    main()
