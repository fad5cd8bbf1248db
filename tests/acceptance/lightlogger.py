"""A real sensor with 18 channels reads narrow-band light: its peaks, found by labrig's fit.

    python -m tests.acceptance.lightlogger

The channels' sensitivities are fitted on two of three wavelengths at full intensity, from what a
spectroradiometer saw; then the wavelengths held out, at four intensities, are told from the 18
readings alone; three times, so that every wavelength is held out once. Printed: how far each peak
is off the spectroradiometer's.
"""

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from labrig.fit.least_squares import FloatArray
from labrig.fit.spectrum import SpectralSystem, fit_spectrum
from labrig.optics import Spectrum, read_curve_file
from labrig.optics.piecewise import hats, quadrature

FOLDER = Path(__file__).parents[3] / "shared/data/light_sources/lightlogger"
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
LEAST_SHARE = 0.002
#: Ways in which a fitted sensitivity may be wrong that are kept of its samples.
UNSURE = 6
LEAST_SIGMA = 0.001
#: Share of the brightest channel that others see of light which is not theirs.
CROSSTALK = 0.005


@dataclass(frozen=True, eq=False)
class Setting:
    """Narrow-band light, what the spectroradiometer saw of it, and the sensor's readings (18,)."""

    nominal_nm: int
    light: Spectrum
    reading: FloatArray

    @property
    def sigma(self) -> FloatArray:
        crosstalk = np.hypot(CROSSTALK * self.reading.max(), LEAST_SIGMA)
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
        sigma = np.hypot(RELATIVE_SIGMA * readings, LEAST_SHARE * readings.max())
        fit = fit_spectrum(readings, sigma, SpectralSystem(KNOTS_NM, lights))
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
    result: FloatArray = (weights * light.at(nodes)) @ hats(KNOTS_NM, nodes)
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


def peak_errors(first_nm: int, percents: tuple[int, ...]) -> dict[tuple[int, int], float]:
    """(Nominal wavelength, per cent) → estimated minus measured peak in nm, of what is held out.

    Parameters
    ----------
    first_nm
        The shortest wavelength held out; every third one from there on is, too.
    """
    held_out = set(range(first_nm, 781, 30))
    trained = [s for s in settings(TRAINED_PCT) if s.nominal_nm not in held_out]
    system, errors = sensor(trained), {}
    for percent in percents:
        for setting in settings(percent):
            nm = setting.nominal_nm
            if nm in held_out and SEEN_NM[0] <= nm <= SEEN_NM[1]:
                fit = fit_spectrum(setting.reading, setting.sigma, system, samples=100)
                estimated = Spectrum("estimate", fit.knots_nm, fit.value)
                errors[nm, percent] = peak_nm(estimated) - peak_nm(setting.light)
    return errors


def main() -> None:
    """Print errors by wavelength and intensity, and their distribution."""
    errors: dict[tuple[int, int], float] = {}
    for first_nm in (380, 390, 400):
        errors |= peak_errors(first_nm, INTENSITIES_PCT)
    print("held out   " + "".join(f"{percent:8d} %" for percent in INTENSITIES_PCT))
    for nm in sorted({nm for nm, _ in errors}):
        row = "".join(f"{errors[nm, percent]:+9.1f} " for percent in INTENSITIES_PCT)
        print(f"{nm:6d} nm  {row}")
    marks = np.percentile(np.abs(list(errors.values())), [25, 50, 75, 90, 100])
    print("|peak error| of", len(errors), "in nm: quartiles", end=" ")
    print("{:.1f} {:.1f} {:.1f}, 90 % {:.1f}, worst {:.1f}".format(*marks))


if __name__ == "__main__":
    main()
