"""Re-radiation matrices: taking apart, applying, other bands."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, strategies as st
from numpy.testing import assert_allclose

from labrig.material import ReradiationMatrix
from labrig.optics import Spectrum

INPUT_NM = np.arange(300.0, 781.0, 10.0)
OUTPUT_NM = np.arange(380.0, 781.0, 10.0)


def dye(peak_nm: float = 470.0, emission_nm: float = 520.0) -> np.ndarray:
    """A bispectral matrix: reflectance 0.3 to 0.7, one dye that emits what it takes in."""
    excitation = np.exp(-(((INPUT_NM - peak_nm) / 30) ** 2))
    emission = np.exp(-(((OUTPUT_NM - emission_nm) / 25) ** 2))
    values = 0.2 * np.outer(emission / emission.sum(), excitation)
    values[OUTPUT_NM[:, np.newaxis] <= INPUT_NM] = 0.0
    reflectance = np.linspace(0.3, 0.7, len(OUTPUT_NM))
    values[OUTPUT_NM[:, np.newaxis] == INPUT_NM] = reflectance
    return values


def matrix(seed: int = 0, sigma: float | None = None) -> ReradiationMatrix:
    values = dye()
    noise = None if sigma is None else np.full(values.shape, sigma)
    if sigma is not None:
        values = values + sigma * np.random.default_rng(seed).standard_normal(values.shape)
    return ReradiationMatrix.from_bands("dye", INPUT_NM, OUTPUT_NM, values, noise)


def test_a_bispectral_matrix_is_taken_apart_and_put_together_again() -> None:
    values = dye()
    apart = ReradiationMatrix.from_bands("dye", INPUT_NM, OUTPUT_NM, values)
    assert_allclose(apart.reflectance, np.linspace(0.3, 0.7, 41))
    assert_allclose(apart.reradiation.max() * 10, values[values < 0.3].max())
    assert_allclose(apart.to_bands(), values, rtol=1e-14)


def test_bands_without_an_input_have_no_reflectance() -> None:
    apart = ReradiationMatrix.from_bands(
        "", np.array([400.0, 410.0]), np.array([410.0, 420.0]), np.array([[0.0, 0.5], [0.1, 0.2]])
    )
    assert apart.reflectance[0] == 0.5
    assert np.isnan(apart.reflectance[1])
    assert_allclose(apart.reradiation, np.array([[0, 0], [0.01, 0.02]]))


def test_light_at_one_wavelength_comes_back_as_the_column() -> None:
    line = Spectrum("line", np.array([464.9, 470.0, 475.1]), np.array([0, 2.0, 0]))
    returned = matrix().under(line)
    column = dye()[:, 17]
    power = 2.0 * 5.1
    assert_allclose(returned.reradiated.value.sum() * 10, power * column[10:].sum(), rtol=0.01)
    assert returned.reflected.value[9] > 0
    assert returned.reflected.value[11] == 0


def test_a_white_without_dye_returns_the_light() -> None:
    white = ReradiationMatrix(
        "white", INPUT_NM, OUTPUT_NM, np.ones(41), np.zeros((41, 49))
    )  # fmt: skip
    light = Spectrum("slope", np.array([300.0, 800.0]), np.array([1.0, 3.0]))
    assert_allclose(white.under(light).total.value, light.at(OUTPUT_NM), rtol=1e-12)


def test_sums_over_the_columns() -> None:
    paper = matrix()
    whole = dye()
    expected = np.where(OUTPUT_NM[:, np.newaxis] > INPUT_NM, whole, 0).sum(axis=0)
    assert_allclose(paper.reradiated_fraction, expected, atol=1e-15)
    assert_allclose(paper.total_fraction[17], expected[17] + paper.reflectance[9])
    assert_allclose(paper.total_fraction[0], expected[0])


def test_one_dye_has_one_singular_value_but_for_the_overlap() -> None:
    values = matrix().singular_values()
    assert values[0] == 1
    assert values[1] < 0.1
    two = dye() + dye(560.0, 620.0) * (OUTPUT_NM[:, np.newaxis] > INPUT_NM)
    assert ReradiationMatrix.from_bands("", INPUT_NM, OUTPUT_NM, two).singular_values()[1] > 0.5


def test_sigma_of_what_is_seen_is_the_scatter() -> None:
    light = Spectrum("slope", np.array([300.0, 800.0]), np.array([1.0, 3.0]))
    returned = [matrix(seed, 1e-3).under(light) for seed in range(400)]
    for part in ("reflected", "reradiated"):
        spectra = [getattr(light_back, part) for light_back in returned]
        scatter = np.std([spectrum.value for spectrum in spectra], axis=0)
        assert_allclose(scatter.mean() / spectra[0].sigma.mean(), 1, atol=0.04)
    fractions = [matrix(seed, 1e-3).reradiated_fraction for seed in range(400)]
    sigma = matrix(0, 1e-3).reradiated_fraction_sigma
    assert sigma is not None
    assert_allclose(np.std(fractions, axis=0)[:40].mean() / sigma[:40].mean(), 1, atol=0.04)


@given(
    inputs=st.lists(st.integers(35, 90), min_size=2, max_size=12, unique=True),
    outputs=st.lists(st.integers(35, 90), min_size=2, max_size=12, unique=True),
)
def test_other_bands_keep_the_light(inputs: list[int], outputs: list[int]) -> None:
    input_nm, output_nm = (10.0 * np.array(sorted(grid)) + 3 for grid in (inputs, outputs))
    paper = matrix()
    other = paper.rebinned(input_nm, output_nm)
    rng = np.random.default_rng(len(inputs))
    power = rng.uniform(1, 2, len(input_nm))
    # The old bands' share of light that is constant in each new band.
    edges = other.input_edges_nm
    steps = Spectrum(
        "steps",
        np.repeat(edges, 2)[1:-1] + np.tile([1e-7, -1e-7], len(power)),
        np.repeat(power, 2),
    )
    absorbed = steps.in_bands(paper.input_edges_nm) * paper.input_width_nm
    fine = paper.reradiation @ absorbed
    low = np.maximum(other.output_edges_nm[:-1, np.newaxis], paper.output_edges_nm[:-1])
    high = np.minimum(other.output_edges_nm[1:, np.newaxis], paper.output_edges_nm[1:])
    expected = np.maximum(high - low, 0) @ fine
    coarse = other.reradiation @ (power * other.input_width_nm) * other.output_width_nm
    assert_allclose(coarse, expected, rtol=1e-6, atol=1e-9)
    inside = ~np.isnan(other.reflectance)
    assert ((other.reflectance[inside] >= 0.3 - 1e-9) & (other.reflectance[inside] <= 0.7)).all()
    assert (inside == ((low < high).any(axis=1))).all()


def test_the_same_bands_change_nothing() -> None:
    paper = matrix(1, 1e-3)
    same = paper.rebinned(INPUT_NM, OUTPUT_NM)
    for name in ("reflectance", "reradiation", "reflectance_sigma", "reradiation_sigma"):
        assert_allclose(getattr(same, name), getattr(paper, name), rtol=1e-12, atol=1e-18)


def test_a_unit_stays_and_an_unknown_one_is_refused() -> None:
    relative = replace(matrix(), unit="relative")
    assert relative.rebinned(INPUT_NM[::2], OUTPUT_NM).unit == "relative"
    with pytest.raises(ValueError, match="expected the unit 1/nm or relative"):
        replace(relative, unit="counts")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("input_nm", "values", "message"),
    [
        (INPUT_NM[::-1], dye(), "rise"),
        (INPUT_NM[:1], dye()[:, :1], "two or more"),
        (INPUT_NM, dye()[:-1], "shape"),
        (INPUT_NM, np.full_like(dye(), np.inf), "infinite"),
    ],
)
def test_what_is_no_matrix_is_refused(
    input_nm: np.ndarray, values: np.ndarray, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        ReradiationMatrix.from_bands("", input_nm, OUTPUT_NM, values)


@pytest.mark.parametrize("bands", [1, 4])
def test_errors_common_to_a_column_add_up_in_its_sum(bands: int) -> None:
    """Half of the variance is one offset a column; of coarser bands more than that."""
    rng = np.random.default_rng(7 + bands)
    sigma, values = 1e-3, dye()
    coarse_nm = OUTPUT_NM[: 40 // bands * bands].reshape(-1, bands).mean(axis=1)
    noisy = []
    for _ in range(600):
        offset, noise = rng.standard_normal((1, 49)), rng.standard_normal(values.shape)
        measured = values + sigma * (offset + noise) / np.sqrt(2)
        sample = replace(
            ReradiationMatrix.from_bands(
                "", INPUT_NM, OUTPUT_NM, measured, np.full(values.shape, sigma)
            ),
            column_correlation=np.full(49, 0.5),
        )
        noisy.append(sample if bands == 1 else sample.rebinned(INPUT_NM, coarse_nm))
    stated = noisy[0].reradiated_fraction_sigma
    assert stated is not None
    scatter = np.std([sample.reradiated_fraction for sample in noisy], axis=0)
    assert_allclose((scatter[:35] / stated[:35]).mean(), 1, atol=0.03)
    entries = np.std([sample.reradiation for sample in noisy], axis=0)
    assert noisy[0].reradiation_sigma is not None
    clear = np.ix_(noisy[0].output_nm > 590, np.arange(20))
    assert_allclose((entries[clear] / noisy[0].reradiation_sigma[clear]).mean(), 1, atol=0.03)
