"""Readings of a spectrometer: correction, σ, absolute scale, and the file in a run folder."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError, LabrigError, UsageError
from labrig.optics import (
    MeasuredSpectrum,
    SpectrometerReading,
    Spectrum,
    lamp_calibration,
    read_spectrometer_reading,
)

GRID_NM = np.linspace(340.0, 1020.0, 400)
DARK_PIXELS = tuple(range(5, 20))


def response(linear: FloatArray, powers: tuple[float, ...]) -> FloatArray:
    """Counts that, divided by the polynomial at themselves, are the linear ones; by bisection."""
    low, high = np.zeros_like(linear), np.full_like(linear, 6e4)
    for _ in range(80):
        middle = (low + high) / 2
        below = middle / np.polynomial.polynomial.polyval(middle, powers) < linear
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return (low + high) / 2


def reading(raw: FloatArray, **changed: Any) -> SpectrometerReading:
    facts: dict[str, Any] = {
        "wavelength_nm": GRID_NM, "raw_counts": raw, "integration_s": 0.1,
        "saturation_counts": 64_000.0, "dark_pixels": DARK_PIXELS,
    }  # fmt: skip
    return SpectrometerReading(**{**facts, **changed})


@settings(max_examples=30)
@given(st.floats(0.7, 1.0), st.floats(0.0, 4e-6), st.floats(-3e-11, 0.0), st.integers(0, 2**32 - 1))
def test_linear_light_is_recovered_whatever_offset_dark_and_response(
    c0: float, c1: float, c2: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    powers = (c0, c1, c2)
    lit = np.ones(len(GRID_NM))
    lit[: DARK_PIXELS[-1] + 1] = 0.0
    light = lit * rng.uniform(0.0, 30_000.0, len(GRID_NM))
    current = lit * rng.uniform(0.0, 500.0, len(GRID_NM))
    offsets = rng.uniform(500.0, 2500.0, (3, 1))
    bright = reading(response(light + current, powers) + offsets, nonlinearity=powers)
    dark = reading(response(current, powers) + offsets[::-1] + 7.0, nonlinearity=powers)
    spectrum = bright.corrected(dark)
    assert spectrum.counts == pytest.approx(light, abs=1e-3)
    without = bright.corrected()
    assert without.counts == pytest.approx(light + current, abs=1e-3)


def noisy(
    rng: np.random.Generator, light: FloatArray, repetitions: int, flicker: float
) -> SpectrometerReading:
    """Shot noise, read noise, flicker of the light and an offset that drifts."""
    shape = (repetitions, len(GRID_NM))
    lit = light * (1 + rng.normal(0.0, flicker, shape))
    raw = (
        lit + rng.normal(0.0, np.sqrt(40.0**2 + light), shape) + rng.normal(1500, 10, (len(lit), 1))
    )
    raw[:, list(DARK_PIXELS)] -= lit[:, list(DARK_PIXELS)]
    return reading(raw)


@pytest.mark.parametrize(
    ("repetitions", "flicker", "seed"), [(3, 0.0, 1), (8, 0.0, 2), (8, 0.01, 3), (25, 0.005, 4)]
)
def test_sigma_is_the_scatter_of_the_counts_about_the_truth(
    repetitions: int, flicker: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    light = 40_000.0 * np.exp(-(((GRID_NM - 520.0) / 60.0) ** 2))
    scores = []
    for _ in range(12):
        spectrum = noisy(rng, light, repetitions, flicker).corrected(
            noisy(rng, 0 * light, repetitions, 0.0)
        )
        assert spectrum.sigma is not None
        scores.append((spectrum.counts - light)[30:] / spectrum.sigma[30:])
    assert np.sqrt(np.mean(np.square(scores))) == pytest.approx(1.0, abs=0.1)
    bright = np.array(scores)[:, light[30:] > 5000.0]
    assert np.sqrt(np.mean(bright**2)) == pytest.approx(1.0, abs=0.12)


def test_one_repetition_has_no_sigma() -> None:
    assert reading(np.ones((1, 400))).corrected().sigma is None
    two = reading(np.ones((2, 400)))
    assert two.corrected(reading(np.ones((1, 400)))).sigma is None


def test_saturated_pixels_are_marked() -> None:
    raw = np.full((3, 400), 1000.0)
    raw[1, 200] = 64_000.0
    assert np.flatnonzero(reading(raw).corrected().saturated).tolist() == [200]


@pytest.mark.parametrize(
    ("changed", "said"),
    [({"integration_s": 0.2}, "same integration time, 0.1 s, got one with 0.2 s"),
     ({"wavelength_nm": GRID_NM + 1}, "of the same spectrometer")],
)  # fmt: skip
def test_a_dark_reading_has_to_fit(changed: dict[str, Any], said: str) -> None:
    raw = np.ones((1, 400))
    with pytest.raises(DataError, match=said):
        reading(raw).corrected(reading(raw, **changed))


@pytest.mark.parametrize(
    "changed",
    [{"raw_counts": np.ones(400)}, {"raw_counts": np.ones((2, 399))},
     {"raw_counts": np.ones((0, 400))}, {"raw_counts": np.full((1, 400), np.nan)},
     {"wavelength_nm": GRID_NM[::-1]}, {"integration_s": 0.0}, {"dark_pixels": (400,)}],
)  # fmt: skip
def test_what_is_no_reading_is_refused(changed: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"expected|some"):
        reading(**{"raw": np.ones((1, 400)), **changed})


def wien(wavelength_nm: FloatArray, kelvin: float = 3100.0) -> FloatArray:
    micrometres = wavelength_nm / 1000
    irradiance: FloatArray = 3.0 / micrometres**5 * np.exp(-14_387.77 / (micrometres * kelvin))
    return irradiance


def test_a_certificate_with_few_wavelengths_gives_the_scale_between_them() -> None:
    rng = np.random.default_rng(5)
    sensitivity = 1e8 * np.exp(-(((GRID_NM - 550.0) / 250.0) ** 2))
    certified_nm = np.arange(350.0, 1001.0, 50.0)
    value = wien(certified_nm)
    lamp = Spectrum("FEL 1000 W", certified_nm, value, 0.02 * value)
    rate = wien(GRID_NM) * sensitivity
    integration_s = 40_000.0 / rate.max()
    standard = reading(
        rate * integration_s + rng.normal(0, 1e-9, (4, 400)),
        integration_s=integration_s,
        dark_pixels=(),
    ).corrected()
    scale = lamp_calibration(standard, lamp)
    assert scale.sigma is not None
    true = 1 / np.interp(scale.wavelength_nm, GRID_NM, sensitivity)
    assert scale.value == pytest.approx(true, rel=1e-4)
    assert scale.sigma / scale.value == pytest.approx(0.02, rel=1e-3)

    other = 1e-3 * np.exp(-(((GRID_NM - 600.0) / 30.0) ** 2))
    counts = other * sensitivity * 0.5 * np.ones((4, 1))
    measured = reading(counts, integration_s=0.5, dark_pixels=(), calibration=scale).corrected()
    assert measured.irradiance is not None
    assert measured.irradiance_sigma is not None
    known = (GRID_NM >= 350.0) & (GRID_NM <= 1000.0)
    assert measured.irradiance[known] == pytest.approx(other[known], rel=1e-3, abs=1e-12)
    assert np.isnan(measured.irradiance[~known]).all()
    peak = measured.irradiance.tolist().index(np.nanmax(measured.irradiance))
    assert measured.irradiance_sigma[peak] / other[peak] == pytest.approx(0.02, rel=0.01)


@pytest.mark.parametrize(
    ("counts", "saturated", "value", "said"),
    [(100.0, True, 1.0, "shorten the integration time"), (100.0, False, 0.0, "above zero"),
     (-1.0, False, 1.0, "too few pixels")],
)  # fmt: skip
def test_a_standard_lamp_has_to_be_seen(
    counts: float, saturated: bool, value: float, said: str
) -> None:
    measured = MeasuredSpectrum(
        GRID_NM, np.full(400, counts), np.ones(400), np.full(400, saturated), 0.1
    )
    lamp = Spectrum("lamp", np.array([400.0, 800.0]), np.array([1.0, value]))
    with pytest.raises(DataError, match=said):
        lamp_calibration(measured, lamp)


@settings(max_examples=20)
@given(st.integers(1, 4), st.integers(0, 2**32 - 1), st.booleans())
def test_what_is_written_is_read(
    tmp_path_factory: pytest.TempPathFactory, repetitions: int, seed: int, calibrated: bool
) -> None:
    rng = np.random.default_rng(seed)
    scale = Spectrum("scale", GRID_NM[:2], np.array([1e-7, 2e-7]), np.array([1e-9, 1e-9]))
    written = reading(
        rng.uniform(0, 65535, (repetitions, 400)), nonlinearity=(0.9, 1e-6),
        calibration=scale if calibrated else None,
    )  # fmt: skip
    path = tmp_path_factory.mktemp("reading") / "000001.csv"
    path.write_text(written.text())
    again = read_spectrometer_reading(path)
    assert np.array_equal(again.raw_counts, written.raw_counts)
    assert np.array_equal(again.wavelength_nm, GRID_NM)
    assert again.text() == written.text()


@settings(max_examples=30)
@given(st.integers(0, 3000), st.text(max_size=4))
def test_a_damaged_file_is_told_in_one_line(
    tmp_path_factory: pytest.TempPathFactory, place: int, inserted: str
) -> None:
    text = SpectrometerReading(GRID_NM[:20], np.ones((2, 20)), 0.1, 65535.0).text()
    path: Path = tmp_path_factory.mktemp("reading") / "000001.csv"
    path.write_text(text[: place % len(text)] + inserted, encoding="utf-8")
    try:
        read_spectrometer_reading(path)
    except (DataError, UsageError) as error:
        assert "\n" not in str(error)


def test_a_missing_file_is_told(tmp_path: Path) -> None:
    with pytest.raises(LabrigError, match=r"missing\.csv"):
        read_spectrometer_reading(tmp_path / "missing.csv")


def test_the_offset_is_the_mean_of_the_dark_pixels() -> None:
    raw = np.full((1, len(GRID_NM)), 1500.0)
    raw[0, list(DARK_PIXELS)] = 1000.0 + 10.0 * np.arange(len(DARK_PIXELS))
    counts = reading(raw).corrected().counts
    mean = 1000.0 + 10.0 * (len(DARK_PIXELS) - 1) / 2
    assert counts[100] == pytest.approx(1500.0 - mean)
