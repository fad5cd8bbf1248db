"""A variable filter calibrated with colour filters, against a truth of another shape."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from labrig.fit.lvf import LvfCalibration, calibrate_lvf
from labrig.fit.lvf.calibration import LOG_ORDER_SIGMA
from labrig.fit.spectrum import CurveError
from labrig.fit.spectrum.system import curve_modes
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
from labrig.optics import (
    Bands,
    CameraResponse,
    Spectrum,
    Transmittance,
    WavelengthMap,
    read_curve_file,
)
from labrig.optics.piecewise import quadrature
from tests.fit import lvf_pictures as made

TRUE_MAP = WavelengthMap(np.array([550.0, 170.0, 5.0]), (0.0, 1000.0))
#: What mercury lines know of it: nothing of the bend beyond 579 nm.
MAP = WavelengthMap(np.array([549.7, 168.0, 2.0]), (0.0, 1000.0), np.diag([0.3, 3.0, 4.0]) ** 2)
CURVE_ERROR = CurveError(relative=0.03, added=0.002)
GREY_CARD = Transmittance("grey", np.array([380.0, 780.0]), np.array([0.17, 0.19]))
FINE_NM = np.arange(380.0, 780.0, 0.1)


def truth(position: FloatArray) -> Callable[[FloatArray], FloatArray]:
    """A skewed peak with a shoulder, that widens along the strip and leaks more in the red."""
    centre = TRUE_MAP.wavelength_nm(position)
    one = np.ones_like(centre)
    leakage = np.where(centre > 600, 0.005, 0.003)
    main = Bands(centre, 24 + (centre - 550) / 50, 0.12 * one, 0.8 * one, leakage)
    shoulder = Bands(centre + 14, 18 * one, 0 * one, 0.07 * one, 0 * one)
    return lambda nm: main.transmission(nm) + shoulder.transmission(nm)


def bent(camera: CameraResponse, seed: int) -> CameraResponse:
    """Curves as another laboratory might have them."""
    rng, curve = np.random.default_rng(seed), camera.sensitivity
    modes = curve_modes(CURVE_ERROR, camera.wavelength_nm, curve, curve.max(axis=0))
    changed = curve + sum(rng.standard_normal() * mode for mode in modes)
    return replace(camera, sensitivity=np.maximum(changed, 0.0))


def calibrated(
    positions: int,
    filters: list[Transmittance],
    lamp: Spectrum,
    camera: CameraResponse,
    shape: Callable[[FloatArray], Callable[[FloatArray], FloatArray]] = truth,
) -> tuple[FloatArray, LvfCalibration]:
    """Seen by a camera, calibrated with the shipped curves of it."""
    position = TRUE_MAP.position(np.linspace(402.0, 698.0, positions))
    knots = [camera.wavelength_nm, lamp.wavelength_nm, *(f.wavelength_nm for f in filters)]
    nodes, weights = quadrature(380.0, 780.0, *knots)
    lit = shape(position)(nodes) * (weights * lamp.at(nodes) * GREY_CARD.at(nodes))
    value = np.stack([(lit * f.at(nodes)) @ camera.at(nodes) for f in filters], axis=1)
    card = weights * lamp.at(nodes) * GREY_CARD.at(nodes)
    value *= card @ made.of_the_house().at(nodes) / (card @ camera.at(nodes))
    top = value.max(axis=(1, 2), keepdims=True)
    sigma = np.sqrt(value * top + (0.01 * top) ** 2) / 300
    noisy = value + sigma * np.random.default_rng(0).standard_normal(value.shape)
    noisy[1, 0, 1] = np.nan  # clipped
    found = calibrate_lvf(
        position, noisy, sigma, filters=filters, lamp=lamp, card=GREY_CARD,
        camera=made.of_the_house(), wavelengths=MAP, curve_error=CURVE_ERROR,
    )  # fmt: skip
    return position, found


def centres_and_widths(transmission: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Of the highest point, and at half of it above the leakage; read off the curve."""
    widths = []
    for row in transmission:
        least = np.median(row)
        widths.append(np.ptp(FINE_NM[row > least + (row.max() - least) / 2]))
    return FINE_NM[transmission.argmax(axis=1)], np.array(widths)


def assert_calibrated(position: FloatArray, found: LvfCalibration) -> None:
    centre, width = centres_and_widths(truth(position)(FINE_NM))
    bands, sigma = found.lvf.bands, found.lvf.sigma
    assert sigma is not None
    error = np.abs(bands.centre_nm - centre)
    inside = (centre > 420) & (centre < 670)
    assert error[inside].max() < 1.0
    assert (error < 3 * sigma.centre_nm).all()
    assert np.abs(bands.fwhm_nm / width - 1)[inside].max() < 0.1
    middle = len(position) // 2
    assert min(sigma.centre_nm[0], sigma.centre_nm[-1]) > 1.2 * sigma.centre_nm[middle]
    drawn = found.lvf.transmission(FINE_NM)
    assert (drawn >= 0).all()
    true = truth(position)(FINE_NM)
    np.testing.assert_allclose(
        (drawn / drawn.max(axis=1, keepdims=True))[inside],
        (true / true.max(axis=1, keepdims=True))[inside],
        atol=0.12,
    )


def step_filters() -> list[Transmittance]:
    """None, and long-pass and short-pass glasses whose edges are all over the spectrum."""
    nm = np.arange(380.0, 781.0, 5.0)
    edges = np.arange(395.0, 720.0, 13.0)
    signs = np.where(np.arange(len(edges)) % 2, 1.0, -1.0)
    passes = [
        0.02 + 0.9 / (1 + np.exp(s * (nm - e) / 12)) for s, e in zip(signs, edges, strict=True)
    ]
    return [
        Transmittance("none", np.array([380.0, 780.0]), np.ones(2)),
        *(Transmittance(f"{k}", nm, value) for k, value in enumerate(passes)),
    ]


def test_a_filter_of_another_shape_with_perturbed_curves() -> None:
    nm = np.arange(380.0, 781.0, 5.0)
    lamp = Spectrum("lamp", nm, np.exp((nm - 780) / 200))
    camera = bent(made.of_the_house(), 1)
    assert_calibrated(*calibrated(11, step_filters(), lamp, camera))


def peaks_of_order(order: float) -> Callable[[FloatArray], Callable[[FloatArray], FloatArray]]:
    """25 nm wide everywhere; above an order of 2 flatter on top than a Gaussian."""

    def peaks(position: FloatArray) -> Callable[[FloatArray], FloatArray]:
        x = np.abs(FINE_NM - TRUE_MAP.wavelength_nm(position)[:, np.newaxis]) / 12.5
        curves = 0.003 + 0.8 * np.exp(-np.log(2) * x**order)
        return lambda nm: np.array([np.interp(nm, FINE_NM, curve) for curve in curves])

    return peaks


def test_with_bands_of_another_shape_widths_err_as_stated() -> None:
    """Shapes one σ from a Gaussian, to either side: so far are the widths apart."""
    nm = np.arange(380.0, 781.0, 5.0)
    lamp = Spectrum("lamp", nm, np.exp((nm - 780) / 200))
    camera = bent(made.of_the_house(), 3)
    found = [
        calibrated(11, step_filters(), lamp, camera, peaks_of_order(2 * np.exp(sigma)))[1].lvf
        for sigma in (-LOG_ORDER_SIGMA, LOG_ORDER_SIGMA)
    ]
    stated = np.mean([lvf.sigma.fwhm_nm for lvf in found if lvf.sigma is not None], axis=0)
    by_shape = (found[0].bands.fwhm_nm - found[1].bands.fwhm_nm) / 2
    assert 0.83 < (by_shape / stated)[2:9].mean() < 1.2


@pytest.mark.parametrize(
    ("shape", "filters", "said"),
    [((2, 3, 3), 3, "6 or more filters"), ((2, 3, 3), 25, "expected values of shape")],
)
def test_pictures_that_do_not_suffice(shape: tuple[int, ...], filters: int, said: str) -> None:
    nm = np.array([380.0, 780.0])
    with pytest.raises(FitError, match=said):
        calibrate_lvf(
            [100.0, 900.0], np.ones(shape), np.ones(shape), filters=step_filters()[:filters],
            lamp=Spectrum("lamp", nm, np.ones(2)), card=GREY_CARD,
            camera=made.of_the_house(), wavelengths=MAP,
        )  # fmt: skip


def test_a_position_without_light() -> None:
    nm, filters = np.array([380.0, 780.0]), step_filters()
    dark = np.zeros((2, len(filters), 3))
    with pytest.raises(FitError, match="position 100: no light"):
        calibrate_lvf(
            [100.0, 900.0], dark, dark + 1.0, filters=filters,
            lamp=Spectrum("lamp", nm, np.ones(2)), card=GREY_CARD,
            camera=made.of_the_house(), wavelengths=MAP,
        )  # fmt: skip


@pytest.mark.campaign
@pytest.mark.parametrize("catalogue", ["rosco", "lee"])
def test_real_filters_under_a_real_lamp(shared_data: Path, catalogue: str) -> None:
    place = {
        "rosco": "filters/art_roscolux/roscolux_transmittance.csv",
        "lee": "filters/color_filter_sds/filters.json",
    }[catalogue]
    curves = list(read_curve_file(shared_data / place).curves.items())
    none = Transmittance("none", np.array([380.0, 780.0]), np.ones(2))
    chosen = [Transmittance(name, *curve) for name, curve in curves[:: len(curves) // 40]]
    camera = bent(made.of_the_house(), 2)
    assert_calibrated(*calibrated(31, [none, *chosen], made.halogen_lamp(), camera))
