"""Integrals of piecewise-linear curves are exact, on whatever grid."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from labrig.optics import Spectrum, Transmittance
from labrig.optics.piecewise import (
    band_integrals,
    band_means,
    edges_from_centres,
    hat_functions,
    quadrature,
)


def made(seed: int, points: int = 12) -> Spectrum:
    rng = np.random.default_rng(seed)
    wavelength_nm = np.sort(rng.uniform(400, 700, points))
    return Spectrum("made", wavelength_nm, rng.uniform(0, 1, points))


@given(seed=st.integers(0, 10**6), bands=st.integers(1, 40))
def test_bands_add_up_to_the_whole(seed: int, bands: int) -> None:
    curve = made(seed)
    edges = np.linspace(390, 710, bands + 1)
    whole = np.trapezoid(curve.value, curve.wavelength_nm)
    integrals = band_integrals(curve.wavelength_nm, curve.value, edges)
    assert integrals.sum() == pytest.approx(whole, rel=1e-12)
    nodes, weights = quadrature(float(edges[0]), float(edges[1]), curve.wavelength_nm)
    assert integrals[0] == pytest.approx(float(weights @ curve.at(nodes)), rel=1e-12, abs=1e-13)


def test_a_line_between_two_points_of_the_grid_is_kept() -> None:
    line = Spectrum("line", np.array([433.0, 433.5, 434.0]), np.array([0.0, 2.0, 0.0]))
    coarse = line.resampled(np.arange(400.0, 500.0, 10.0))
    assert coarse.value.sum() * 10 == pytest.approx(1.0)
    assert coarse.value[3] == pytest.approx(0.1)


@given(seed=st.integers(0, 10**6))
def test_products_of_four_curves_are_exact(seed: int) -> None:
    curves = [made(seed + k) for k in range(4)]
    knots = [curve.wavelength_nm for curve in curves]
    nodes, weights = quadrature(420.0, 680.0, *knots)
    finer_nodes, finer_weights = quadrature(420.0, 680.0, *knots, np.linspace(420, 680, 1777))
    at = np.prod([curve.at(nodes) for curve in curves], axis=0)
    finer = np.prod([curve.at(finer_nodes) for curve in curves], axis=0)
    assert weights @ at == pytest.approx(float(finer_weights @ finer), rel=1e-12)


def test_tents_span_the_curves_of_their_grid() -> None:
    curve = made(3)
    wavelength_nm = np.linspace(380.0, 720.0, 341)
    hats = hat_functions(curve.wavelength_nm, wavelength_nm)
    np.testing.assert_allclose(hats @ curve.value, curve.at(wavelength_nm), atol=1e-14)


def test_a_filter_goes_on_beyond_its_table() -> None:
    gel = Transmittance("gel", np.array([405.0, 700.0]), np.array([0.2, 0.8]))
    np.testing.assert_allclose(gel.in_bands([300.0, 400.0, 710.0, 800.0])[[0, 2]], [0.2, 0.8])
    assert gel.at(390.0) == 0.2


def test_means_of_several_columns() -> None:
    values = np.stack([np.arange(3.0), np.ones(3)], axis=1)
    means = band_means(np.array([400.0, 500.0, 600.0]), values, edges_from_centres([450.0, 550.0]))
    np.testing.assert_allclose(means, [[0.5, 1.0], [1.5, 1.0]])
