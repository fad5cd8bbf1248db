"""Errors of a camera's curves: those that were measured with them, else those of published ones."""

from dataclasses import replace

import numpy as np
import pytest

from labrig.fit.spectrum import CurveError, camera_modes, curve_modes
from labrig.optics import read_camera

NODES = np.arange(400.0, 700.0, 5.0)
PUBLISHED = CurveError()


def test_measured_curves_have_their_own_sigma() -> None:
    camera = read_camera("canon_eos_5d_mark_ii")
    sigma = np.outer(np.linspace(0.01, 0.03, len(camera.wavelength_nm)), [1.0, 0.5, 2.0])
    modes = np.array(camera_modes(replace(camera, sigma=sigma), NODES, PUBLISHED))
    own = [np.interp(NODES, camera.wavelength_nm, column) for column in sigma.T]
    assert pytest.approx(np.array(own), rel=0.01) == np.sqrt((modes**2).sum(axis=0)).T
    correlation = np.einsum("mqc,mrc->qr", modes, modes)
    assert correlation[0, 20] == pytest.approx(0, abs=1e-12)
    assert correlation[0, 1] > 0.9 * correlation[0, 0]


def test_published_curves_err_as_laboratories_disagree() -> None:
    camera = read_camera("canon_eos_5d_mark_ii")
    modes = camera_modes(camera, NODES, PUBLISHED)
    peaks = camera.sensitivity.max(axis=0)
    assert np.array_equal(modes, curve_modes(PUBLISHED, NODES, camera.at(NODES), peaks))
    assert camera_modes(camera, NODES, None) == []
