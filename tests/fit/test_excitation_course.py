"""Course of excitation within bands, against measured excitation spectra of dyes."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from labrig.fit.excitation import excitation_course
from labrig.foundation.arrays import FloatArray

BANDS_NM: dict[str, FloatArray] = {
    "wide": np.linspace(400.0, 700.0, 9),
    "narrow": np.linspace(400.0, 700.0, 16),
}
FINE_NM = np.arange(400.25, 700.0, 0.5)
CELLS_PER_BAND = {"wide": 15, "narrow": 8}


def cells_of(bands: str) -> FloatArray:
    edges = BANDS_NM[bands]
    return np.linspace(edges[0], edges[-1], CELLS_PER_BAND[bands] * (len(edges) - 1) + 1)


def means(fine_nm: FloatArray, rate: FloatArray, edges_nm: FloatArray) -> FloatArray:
    number = np.searchsorted(edges_nm, fine_nm) - 1
    return np.bincount(number, rate) / np.bincount(number)


def test_an_exponential_course_is_found() -> None:
    cells_nm, edges_nm = cells_of("wide"), BANDS_NM["wide"]
    middle_nm = (cells_nm[1:] + cells_nm[:-1]) / 2
    fine_nm = np.arange(400.05, 700.0, 0.1)
    mean = means(fine_nm, np.exp(-(fine_nm - 400) / 60), edges_nm)
    course = excitation_course(cells_nm, edges_nm, mean, 0.01 * mean)
    band = np.searchsorted(edges_nm, middle_nm) - 1
    true = -(middle_nm - 400) / 60 - np.log(mean[band])
    inner = (band > 0) & (band < 7)
    assert course.log_rate[inner] == pytest.approx(true[inner], abs=0.15)
    assert [np.exp(course.log_rate[band == b]).mean() for b in range(8)] == pytest.approx([1.0] * 8)


def test_bands_without_excitation_leave_the_course_of_others() -> None:
    cells_nm, edges_nm = cells_of("wide"), BANDS_NM["wide"]
    mean = np.array([1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    course = excitation_course(cells_nm, edges_nm, mean, np.full(8, 1e-3))
    sigma = np.sqrt((course.modes**2).sum(axis=0))
    assert np.isfinite(course.log_rate).all()
    assert (np.abs(course.log_rate[:45]) < 2 * sigma[:45]).all()


def light_within(
    low: float, high: float, at_nm: float, fwhm_nm: float, nm: FloatArray
) -> FloatArray:
    """Shares of a light at some wavelengths, all of it between two."""
    inside = (nm > low) & (nm < high)
    weight = inside * np.exp(-4 * np.log(2) * ((nm - at_nm) / fwhm_nm) ** 2)
    return np.asarray(weight / weight.sum())


def measured_dyes(shared_data: Path) -> Iterator[FloatArray]:
    """Every sixth dye that visible light excites, on a grid of 0.5 nm."""
    path = shared_data / "fluorophores/mcnamara_boswell_excitation.csv"
    table = np.genfromtxt(path, delimiter=",", skip_header=1)
    for column in table[:, 1::6].T:
        rate = np.interp(FINE_NM, table[:, 0], np.maximum(np.nan_to_num(column), 1e-4))
        if means(FINE_NM, rate, BANDS_NM["wide"]).max() > 0.05:
            yield rate


def made_dyes(count: int = 60) -> Iterator[FloatArray]:
    """Dyes with a shoulder, a vibration of 1200/cm above the band's origin."""
    rng = np.random.default_rng(7)
    for origin_nm in rng.uniform(420, 680, count):
        above = 1e7 * (1 / FINE_NM - 1 / origin_nm)
        width, shoulder = rng.uniform(200, 450), rng.uniform(0.2, 0.7)
        band = 1 / np.cosh(above / width)
        vibration = shoulder / np.cosh((above - 1200) / (1.2 * width))
        yield np.maximum(band + vibration, 1e-4)


@pytest.mark.parametrize("bands", list(BANDS_NM))
def test_light_within_bands_of_made_dyes(bands: str) -> None:
    assert_light_within_bands_is_known(bands, made_dyes())


def test_light_within_bands_of_measured_dyes(shared_data: Path) -> None:
    for bands in BANDS_NM:
        assert_light_within_bands_is_known(bands, measured_dyes(shared_data))


def assert_light_within_bands_is_known(bands: str, dyes: Iterator[FloatArray]) -> None:
    """Lights of 8 and 20 nm near the bands' middles: nearer than their even bands, and σ is right.

    Some dyes have shoulders and lines: large deviations are more frequent than a Gaussian's.
    """
    rng = np.random.default_rng(31)
    edges_nm, cells_nm = BANDS_NM[bands], cells_of(bands)
    middle_nm, fine_nm = (cells_nm[1:] + cells_nm[:-1]) / 2, FINE_NM
    before, after, pulls = [], [], []
    for rate in dyes:
        mean = means(fine_nm, rate, edges_nm)
        course = excitation_course(cells_nm, edges_nm, mean, 0.02 * mean)
        for band in np.flatnonzero(mean > 0.02 * mean.max()):
            low, high = edges_nm[band : band + 2]
            at_nm = (low + high) / 2 + rng.uniform(-0.15, 0.15) * (high - low)
            light = partial(light_within, low, high, at_nm, rng.choice([8, 20]))
            own = (middle_nm > low) & (middle_nm < high)
            seen = light(middle_nm) * np.exp(course.log_rate)
            of_mean = own * np.exp(course.log_rate)
            share = seen / seen.sum() - of_mean / of_mean.sum()
            sigma = np.hypot(0.01, np.linalg.norm(course.modes @ share))
            true = np.log(light(fine_nm) @ rate / mean[band])
            found = float(np.log(seen.sum()))
            before.append(true)
            after.append(found - true)
            pulls.append(after[-1] / sigma)
    largest_before, largest_after = np.quantile(np.abs([before, after]), 0.9, axis=1)
    assert largest_after < 0.65 * largest_before
    assert 0.65 < np.sqrt(np.mean(np.square(pulls))) < 1.25
    assert np.quantile(np.abs(pulls), 0.95) < 2
