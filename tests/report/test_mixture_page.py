"""The page of a mixture: what it says, draws and writes."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from labrig.fit import fit_mixture
from labrig.material import (
    ReradiationMixture,
    appearance,
    colour_pair,
    with_sigma,
)
from labrig.optics import read_light
from labrig.process import report_mixture
from labrig.report import FittedMatrix, Section, mixture_report
from labrig.report.chart import Chart, ErrorBars, Line, Points
from labrig.report.mixture_figures import noise_floor
from labrig.report.reradiation_figures import emission_spectra, excitation_spectra
from tests.material.reradiation.synthetic import ORANGE, YELLOW, measurement
from tests.report.about import ABOUT
from tests.warned import codes

LIGHTS = tuple(read_light(name) for name in ("D65", "A", "450nm", "395nm"))


@pytest.fixture(scope="module")
def fitted() -> FittedMatrix:
    matrix = with_sigma(measurement(21, YELLOW, ORANGE).measured)
    return FittedMatrix(matrix, fit_mixture(matrix), LIGHTS)


def section(fitted: FittedMatrix, title: str) -> Section:
    report = mixture_report(fitted, ABOUT)
    return next(part for part in (*report.sections, *report.methods) if part.title == title)


def chart(part: Section, name: str) -> Chart:
    drawing = next(picture.drawing for picture in part.figures if picture.name == name)
    assert isinstance(drawing, Chart)
    return drawing


def test_components_are_those_of_the_fit(fitted: FittedMatrix) -> None:
    (table,) = section(fitted, "Mixture").tables
    mixture = fitted.fit.mixture
    for row, weight, mean, covariance in zip(
        table.rows, mixture.weights, mixture.mean_nm, mixture.covariance_nm2, strict=True
    ):
        assert_allclose([float(cell) for cell in row[1:4]], [weight, *mean], atol=0.06)
        sd = [float(number) for number in row[4].split(",")]
        assert_allclose(np.square(sd), np.diag(covariance), rtol=0.02)


def test_spectra_hold_both_directions_and_sigma(fitted: FittedMatrix) -> None:
    matrix, model = fitted.matrix, fitted.model
    assert matrix.reradiation_sigma is not None
    for spectra, is_emission in (
        (emission_spectra(matrix, model), True),
        (excitation_spectra(matrix, model), False),
    ):
        assert len(spectra) >= 2
        for spectrum in spectra:
            given, others = (
                (matrix.input_nm, matrix.output_nm)
                if is_emission
                else (matrix.output_nm, matrix.input_nm)
            )
            place, rows = given == spectrum.given_nm, np.isin(others, spectrum.wavelength_nm)
            cells = np.ix_(rows, place) if is_emission else np.ix_(place, rows)
            assert spectrum.sigma is not None
            assert spectrum.model is not None
            assert_allclose(spectrum.value, 10 * matrix.reradiation[cells].ravel())
            assert_allclose(spectrum.sigma, 10 * matrix.reradiation_sigma[cells].ravel())
            assert_allclose(spectrum.model, 10 * model.reradiation[cells].ravel())
    part = section(fitted, "Spectra")
    for name in ("emission", "excitation"):
        (panel,) = chart(part, name).panels
        assert sum(isinstance(mark, ErrorBars) for mark in panel.marks) >= 2


def test_densities_have_an_integral_of_1(fitted: FittedMatrix) -> None:
    part = section(fitted, "Spectra")
    for name in ("emission-density", "excitation-density"):
        (panel,) = chart(part, name).panels
        points = next(mark for mark in panel.marks if isinstance(mark, Points))
        curve = [mark for mark in panel.marks if isinstance(mark, Line)][-1]
        assert_allclose(points.y.sum() * 10, 1)
        assert_allclose(np.trapezoid(curve.y, curve.x), 1, atol=0.03)


def test_what_was_not_measured_is_not_drawn() -> None:
    sample = measurement(3, YELLOW).measured
    gaps = sample.reradiation.copy()
    gaps[12:15] = np.nan
    for spectrum in emission_spectra(replace(sample, reradiation=gaps)):
        assert np.isfinite(spectrum.value).all()
        assert not np.isin(sample.output_nm[12:15], spectrum.wavelength_nm).any()


def test_the_noise_floor_is_the_mean_variance_per_band() -> None:
    matrix = measurement(1, YELLOW).measured
    assert noise_floor(matrix) is None
    sigma = np.full(matrix.reradiation.shape, 3e-4)
    sigma[:, 4] = np.nan
    floor = noise_floor(replace(matrix, reradiation_sigma=sigma))
    assert floor == pytest.approx((10 * 3e-4) ** 2)


def test_numbers_of_components_are_compared(fitted: FittedMatrix) -> None:
    part = section(fitted, "Number of components")
    assert {picture.name for picture in part.figures} == {"error", "bic"}
    assert len(part.tables[0].rows) == len(fitted.fit.candidates) > 1
    (panel,) = chart(part, "error").panels
    drawn = next(mark for mark in panel.marks if isinstance(mark, Line))
    assert drawn.y.tolist() == [one.reduced_chi2 for one in fitted.fit.candidates]
    thresholded = FittedMatrix(fitted.matrix, fit_mixture(fitted.matrix, threshold=1e-3), LIGHTS)
    (panel,) = chart(section(thresholded, "Number of components"), "error").panels
    noise = next(mark for mark in panel.marks if isinstance(mark, Line))
    assert "10⁻" in panel.y.label
    unit = 10.0 ** -int(panel.y.label[-1].translate(str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹", "0123456789")))
    assert noise.y.tolist() == pytest.approx([(noise_floor(fitted.matrix) or 0.0) / unit] * 2)
    alone = FittedMatrix(fitted.matrix, fit_mixture(fitted.matrix, 1), LIGHTS)
    part = section(alone, "Number of components")
    assert not part.figures
    compared = replace(alone, others=fitted.fit.candidates)
    assert compared.candidates[1:] == fitted.fit.candidates[1:]
    assert compared.candidates[0] is alone.fit.candidates[0]
    (panel,) = chart(section(compared, "Number of components"), "bic").panels
    taken = [mark for mark in panel.marks if isinstance(mark, Points)][-1]
    assert taken.x.tolist() == [1.0]


def test_both_colours_of_a_light_are_on_one_scale(fitted: FittedMatrix) -> None:
    part = section(fitted, "Colours")
    for swatches, difference in zip(part.content, fitted.differences, strict=True):
        assert swatches.delta_e == f"{difference.delta_e:.2f}"
        channels = [
            np.frombuffer(bytes.fromhex(colour[1:]), np.uint8).astype(float)
            for colour in (swatches.measured, swatches.mixture)
        ]
        assert np.max(channels) > 100
        if difference.white == "light":
            assert np.abs(channels[0] - channels[1]).max() < 30
    same = FittedMatrix(fitted.model, fitted.fit, LIGHTS)
    for swatches in section(same, "Colours").content:
        assert swatches.measured == swatches.mixture


def test_a_narrow_light_leaves_an_eye_the_screens_white(fitted: FittedMatrix) -> None:
    narrow = colour_pair(fitted.model, fitted.matrix, LIGHTS[2])
    assert narrow.white == "D65"
    assert_allclose(narrow.reference_xyz[1], 0.5)
    ratio = narrow.surface_xyz / appearance(fitted.model, LIGHTS[2]).xyz
    assert_allclose(ratio, ratio[0])


def test_relative_reradiation_has_no_colours(fitted: FittedMatrix) -> None:
    matrix = replace(fitted.matrix, unit="relative")
    relative = FittedMatrix(matrix, fitted.fit, LIGHTS)
    assert relative.differences == ()
    titles = [part.title for part in mixture_report(relative, ABOUT).sections]
    assert titles == ["Mixture", "Spectra", "Number of components"]


def test_a_mixture_without_sigma_has_no_bars() -> None:
    nm = np.arange(300.0, 781.0, 10.0)
    dye = ReradiationMixture(
        20.0, np.ones(1), np.array([[460.0, 520.0]]), np.array([[[900.0, 100], [100, 400]]])
    )
    matrix = dye.to_matrix(nm, nm, name="dye", reflectance=np.full(49, 0.2))
    fitted = FittedMatrix(matrix, fit_mixture(matrix, 1, threshold=1e-6), LIGHTS[:1])
    for part in mixture_report(fitted, ABOUT).sections:
        for picture in part.figures:
            if isinstance(picture.drawing, Chart):
                marks = [mark for panel in picture.drawing.panels for mark in panel.marks]
                assert not any(isinstance(mark, ErrorBars) for mark in marks)
            assert "1 σ" not in picture.caption or picture.name == "mixture"


@pytest.mark.drawn
def test_the_page_stands_alone(fitted: FittedMatrix, tmp_path: Path) -> None:
    file = tmp_path / "paper.csv"
    file.write_text("the matrix")
    command = "labrig fit mixture 'my paper.csv' --components 2"
    out = tmp_path / "deep" / "mixture"
    report = report_mixture(file, fitted, command, out)
    page = report.read_text(encoding="utf-8")
    assert page.count("<figure") == 10
    assert "my paper.csv" in page
    assert "No warnings." in page
    assert not re.search(r'(?:src|href)="(?!data:|#|figures/|https?://)', page)
    links = re.findall(r'href="(figures/[^"]+)"', page)
    assert len(links) == 10
    assert all((out / link).stat().st_size > 1000 for link in links)
    assert (out / "fit.json").stat().st_size > 500


def test_a_fit_that_did_not_converge_has_a_warning(fitted: FittedMatrix) -> None:
    unfinished = FittedMatrix(fitted.matrix, replace(fitted.fit, converged=False), LIGHTS)
    assert codes(mixture_report(unfinished, ABOUT).warnings) == ["fit-unconverged"]
