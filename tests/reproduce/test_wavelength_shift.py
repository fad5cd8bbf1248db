"""Wavelengths that paths draw at surfaces, against sums over fine grids and over measured bands."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray
from scipy.integrate import quad

from labrig.fit import fit_mixture
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.material import ReradiationMatrix, ReradiationMixture, corrected
from labrig.reproduce import (
    LampWavelengths,
    WavelengthShift,
    balance,
    direct_light,
    rotated_wavelengths,
)
from labrig.reproduce.transport.wavelength_shift import Start
from tests.material.reradiation import bfc450
from tests.material.reradiation.formats.matrices import two_dyes
from tests.material.reradiation.mixtures import random_mixture

NM = np.arange(305.0, 780.0, 10.0)
REFLECTANCE = 0.3 + 0.4 * (NM - 300) / 480
#: Two dyes that overlap, one of them skewed; the second reaches over the diagonal.
DYES = ReradiationMixture(
    30.0,
    np.array([0.7, 0.3]),
    np.array([[440.0, 520.0], [540.0, 570.0]]),
    np.array([[[900.0, 100.0], [100.0, 400.0]], [[400.0, -50.0], [-50.0, 900.0]]]),
    np.array([[0.0, 0.0], [-0.3, 0.4]]),
)
STARTS: tuple[Start, Start] = ("eye", "lamp")
DRAWS = 40_000


def paper() -> WavelengthShift:
    return WavelengthShift(DYES.to_matrix(NM, NM, reflectance=REFLECTANCE), DYES)


def is_within(values: FloatArray, expected: float, sigmas: float = 3.0) -> bool:
    """Whether the mean agrees with what is expected, within so many of its σ."""
    sigma = values.std() / np.sqrt(len(values))
    return bool(abs(values.mean() - expected) <= sigmas * sigma)


def are_same_bands(matrix: ReradiationMatrix) -> NDArray[np.bool_]:
    return np.asarray(matrix.output_nm[:, np.newaxis] == matrix.input_nm)


def integral(start: Start, given_nm: float, power: float = 0.0) -> float:
    """Integral of the mixture over the other wavelength, times its power, by quadrature."""

    def value(other_nm: float) -> float:
        pair = (other_nm, given_nm) if start == "eye" else (given_nm, other_nm)
        return float(DYES.reradiation(*pair) * other_nm**power)

    ends = (300.0, given_nm) if start == "eye" else (given_nm, 780.0)
    return float(quad(value, *ends, limit=200)[0])


@pytest.mark.parametrize("start", STARTS)
@pytest.mark.parametrize("given_nm", [455.0, 515.0, 585.0])
def test_parts_weights_and_wavelengths_are_those_of_the_mixture(
    start: Start, given_nm: float
) -> None:
    surface = paper()
    known, reflectance = np.full(DRAWS, given_nm), REFLECTANCE[int((given_nm - 300) // 10)]
    rng = np.random.default_rng((int(given_nm), len(start)))
    drawn = surface.draw(known, start, rng.random((3, DRAWS)))
    shifted = integral(start, given_nm)
    kept = surface.reflected_part([given_nm], start)
    assert kept == pytest.approx(reflectance / (reflectance + shifted), rel=1e-8)
    assert drawn.weight == pytest.approx(reflectance + shifted, rel=1e-8)
    assert is_within(drawn.is_reflected.astype(float), float(kept[0]))
    assert (drawn.wavelength_nm[drawn.is_reflected] == given_nm).all()
    other = surface.draw_shift(known, start, rng.random((2, DRAWS)))
    assert is_within(other, integral(start, given_nm, 1.0) / shifted)
    assert is_within(other**3, integral(start, given_nm, 3.0) / shifted)


@pytest.mark.parametrize("start", STARTS)
def test_densities_integrate_to_one_and_are_none_beyond_the_stokes_side(start: Start) -> None:
    surface = paper()
    fine = np.arange(300.005, 780.0, 0.01)
    for given_nm in (400.0, 540.0, 700.0):
        pdf = surface.density(given_nm, fine, start)
        assert pdf.sum() * 0.01 == pytest.approx(1.0, abs=1e-5)
        beyond = fine > given_nm if start == "eye" else fine < given_nm
        assert not pdf[beyond].any()


#: Some powers of ten above the least normal number.
MIN_NORMAL = 1e-290


@given(seed=st.integers(0, 10_000), given_nm=st.floats(330, 750))
@settings(max_examples=25)
def test_densities_are_the_conditional_ones_within_the_range(seed: int, given_nm: float) -> None:
    mixture = random_mixture(seed)
    surface = WavelengthShift(mixture.to_matrix(NM, NM), mixture)
    others = np.arange(302.5, 780.0, 5.0)
    # On the diagonal itself the density jumps.
    others = others[np.abs(others - given_nm) > 1e-6]
    for start in STARTS:
        conditional = mixture.input_given_output if start == "eye" else mixture.output_given_input
        reached = conditional.cdf([300.0, 780.0], given_nm)
        inside = float(reached[1] - reached[0])
        # A sum of numbers below the normal ones has lost its digits.
        if inside < 1e-9 or conditional.integral(given_nm) < MIN_NORMAL:
            continue
        expected = conditional.pdf(others, given_nm) / inside
        assert surface.density(given_nm, others, start) == pytest.approx(
            expected, rel=1e-6, abs=1e-9
        )


def test_the_ends_of_the_random_numbers_draw_the_ends_of_the_range() -> None:
    """The component is the one that reaches the number, also at 0 and just below 1."""
    last = np.nextafter(1.0, 0.0)
    random = np.array([[last] * 4, [0.0, 0.0, last, last], [0.0, last, 0.0, last]])
    drawn = paper().draw(np.full(4, 500.0), "lamp", random)
    assert not drawn.is_reflected.any()
    assert drawn.wavelength_nm[[0, 2]] == pytest.approx(500.0, abs=1e-9)
    assert (drawn.wavelength_nm[[1, 3]] > 600).all()
    assert (drawn.wavelength_nm <= 780).all()


def test_without_re_radiation_all_is_reflected() -> None:
    grey = ReradiationMatrix.from_bands("grey", NM, NM, np.diag(REFLECTANCE))
    known = np.linspace(301, 779, 300)
    for start in STARTS:
        drawn = WavelengthShift(grey, None).draw(
            known, start, np.random.default_rng(4).random((3, 300))
        )
        assert drawn.is_reflected.all()
        assert (drawn.wavelength_nm == known).all()
        assert (drawn.weight == REFLECTANCE[((known - 300) // 10).astype(int)]).all()


def test_beyond_the_bands_nothing_comes_back() -> None:
    drawn = paper().draw([290.0, 800.0], "lamp", np.full((3, 2), 0.5))
    assert drawn.weight.tolist() == [0.0, 0.0]


@pytest.mark.parametrize("start", STARTS)
def test_a_matrix_is_what_weights_tell_where_the_mixture_only_draws(start: Start) -> None:
    """The truth has light where the mixture has none, an unlike shape, and negative noise."""
    rng = np.random.default_rng(7)
    truth = DYES.to_matrix(NM, NM, reflectance=REFLECTANCE)
    noisy = truth.reradiation * rng.uniform(0.3, 2, (48, 48)) + rng.normal(0, 1e-4, (48, 48))
    matrix = replace(truth, reradiation=noisy)
    surface = WavelengthShift(matrix, DYES, reradiates="matrix")
    stokes = np.where(matrix.is_stokes, noisy, 0.0) * 10
    for band in (12, 23, 40):
        given_nm = np.full(DRAWS, NM[band])
        sums = stokes[band] if start == "eye" else stokes[:, band]
        drawn = surface.draw(given_nm, start, rng.random((3, DRAWS)))
        expected = REFLECTANCE[band] + sums.sum()
        assert is_within(drawn.weight, expected), (band, drawn.weight.mean(), expected)
        # Each band has its own share, the uneven ones, too.
        middle = NM[sums.argmax()]
        share = drawn.weight * (np.abs(drawn.wavelength_nm - middle) < 5)
        assert is_within(share, sums.max() + (REFLECTANCE[band] if middle == NM[band] else 0))


def test_a_matrix_of_two_dyes_under_noise_gives_back_its_sums() -> None:
    assert_gives_back_its_sums(two_dyes(4))


@pytest.mark.usefixtures("shared_data")
def test_measured_matrices_give_back_their_sums() -> None:
    samples = {sample.name: sample for sample in bfc450.samples()}
    for name in ("PAPYEL", "PAPMAG", "GOLFYE"):
        assert_gives_back_its_sums(samples[name])


def assert_gives_back_its_sums(measured: ReradiationMatrix) -> None:
    matrix, name = corrected(measured), measured.name
    surface = WavelengthShift(matrix, fit_mixture(matrix, 4, refine=False).mixture, "matrix")
    rng = np.random.default_rng(len(name) * ord(name[-1]))
    light = np.where(matrix.is_stokes, matrix.reradiation, 0.0) * 10
    light += np.where(are_same_bands(matrix), matrix.reflectance[:, np.newaxis], 0.0)
    for start in STARTS:
        given_nm, axis = (matrix.output_nm, 1) if start == "eye" else (matrix.input_nm, 0)
        each = DRAWS // 10
        known = np.repeat(given_nm, each)
        weight = surface.draw(known, start, rng.random((3, len(known)))).weight
        weight -= np.repeat(light.sum(axis=axis), each)
        assert is_within(weight, 0.0)
        by_band = weight.reshape(-1, each)
        sigma = by_band.std(axis=1) / np.sqrt(each)
        # Entries that are noise have rare and large weights: σ of one band is not well known.
        assert np.sqrt(np.mean((by_band.mean(axis=1)[sigma > 0] / sigma[sigma > 0]) ** 2)) < 1.4


@pytest.mark.parametrize("width_nm", [1.0, 480.0])
def test_direct_light_is_unbiased_under_narrow_and_broad_lamps(width_nm: float) -> None:
    edges = np.array([300.0, 450.0, 451.0, 780.0])
    radiance = np.array([0.0, 5.0, 0.0]) if width_nm < 2 else np.array([1.0, 5.0, 0.5])
    lamp, surface = LampWavelengths(edges, radiance), paper()
    for number, output_nm in enumerate((450.5, 525.0, 600.0)):
        random = np.random.default_rng((number, int(width_nm))).random((3, DRAWS))
        estimate = direct_light(surface, lamp, np.full(DRAWS, output_nm), random)

        def seen(input_nm: float, output_nm: float = output_nm) -> float:
            return float(DYES.reradiation(input_nm, output_nm) * lamp.radiance_at(input_nm))

        parts = [quad(seen, *pair)[0] for pair in ((300, 450), (450, 451), (451, 780))]
        reflected = REFLECTANCE[int((output_nm - 300) // 10)] * float(lamp.radiance_at(output_nm))
        assert is_within(estimate, sum(parts) + reflected)


def test_the_balance_is_as_good_as_its_theorem_says() -> None:
    surface, output = paper(), np.full(DRAWS, 525.0)
    random = np.random.default_rng(5).random((3, DRAWS))
    for radiance in ([0.0, 5.0, 0.0], [1.0, 1.0, 1.0]):
        lamp = LampWavelengths(np.array([300.0, 450.0, 451.0, 780.0]), np.array(radiance))
        both = direct_light(surface, lamp, output, random)
        from_surface = surface.draw_shift(output, "eye", random[:2])
        from_lamp = lamp.draw(random[2])
        alone = [
            (surface.reradiation(nm, output) * lamp.radiance_at(nm) / pdf).std()
            for nm, pdf in (
                (from_surface, surface.density(output, from_surface, "eye")),
                (from_lamp, lamp.density(from_lamp)),
            )
        ]
        # Veach and Guibas, *Optimally combining sampling techniques*, 1995, theorem 1.
        assert both.var() < min(alone) ** 2 + 0.5 * both.mean() ** 2
        assert both.std() < 0.5 * max(alone)


def test_weights_of_the_balance_sum_to_one() -> None:
    densities = np.random.default_rng(6).random((3, 50))
    weights = [balance(densities[k], *np.delete(densities, k, axis=0)) for k in range(3)]
    assert np.sum(weights, axis=0) == pytest.approx(1.0)


def test_rotated_wavelengths_are_evenly_apart_and_each_uniform() -> None:
    hero = np.random.default_rng(8).uniform(300, 780, 20_000)
    turned = rotated_wavelengths(hero, 3)
    assert (turned[0] == hero).all()
    assert np.diff(np.sort(turned, axis=0), axis=0) == pytest.approx(160.0)
    for row in turned:
        assert is_within(row, 540.0)
        assert is_within((row - 540) ** 2, 480**2 / 12)


def test_improper_surfaces_and_draws_are_refused() -> None:
    matrix = DYES.to_matrix(NM, NM, reflectance=REFLECTANCE)
    with pytest.raises(UsageError, match="expected a mixture"):
        WavelengthShift(matrix, None)
    with pytest.raises(UsageError, match="relative"):
        WavelengthShift(replace(matrix, unit="relative"), DYES)
    with pytest.raises(UsageError, match=r"\(3, n\), got \(2,\) and \(3, 1\)"):
        paper().draw([400.0, 500.0], "eye", np.zeros((3, 1)))
    with pytest.raises(UsageError, match="expected edges"):
        LampWavelengths(np.array([300.0, 400.0]), np.ones(2))
    with pytest.raises(UsageError, match="that rise"):
        LampWavelengths(np.array([300.0, 300.0]), np.ones(1))
    with pytest.raises(UsageError, match="not 0 in all"):
        LampWavelengths(np.array([300.0, 400.0]), np.zeros(1))
    with pytest.raises(UsageError, match="1 or more wavelengths"):
        rotated_wavelengths([400.0], 0)
