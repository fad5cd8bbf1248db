"""The simulated camera's curves differ from the shipped ones as laboratories do."""

import json
from pathlib import Path

import numpy as np
import pytest

from labrig.foundation.errors import UsageError
from labrig.material.file import Material, State, read_material
from labrig.sim.lamp import CELL_NM, WAVELENGTH_NM
from labrig.sim.optics import CameraCurves, bent_curves, emission, measured_curves, vignetting
from labrig.sim.phosphor import band_cells


@pytest.mark.parametrize("seed", range(8))
def test_curves_are_bent_by_2_to_6_percent(seed: int) -> None:
    true = measured_curves().sensitivity
    bent = bent_curves(np.random.default_rng(seed)).sensitivity
    assert bent.min() >= 0
    assert bent.max(axis=1) == pytest.approx(true.max(axis=1))
    seen = (WAVELENGTH_NM > 400) & (WAVELENGTH_NM < 700)
    difference = (bent / bent.max(axis=1, keepdims=True))[:, seen]
    difference -= (true / true.max(axis=1, keepdims=True))[:, seen]
    rms = np.sqrt((difference**2).mean(axis=1))
    assert np.all((rms > 0.02) & (rms < 0.06))
    # Smooth: the difference does not scatter from one 2.5 nm cell to the next.
    assert np.abs(np.diff(difference, 2, axis=1)).max() < 0.015


def test_a_smooth_difference_is_made_strong_enough() -> None:
    """Seed 282 draws one so flat that it hardly bends the curves."""
    true = measured_curves().sensitivity
    bent = bent_curves(np.random.default_rng(282)).sensitivity
    seen = (WAVELENGTH_NM > 400) & (WAVELENGTH_NM < 700)
    difference = ((bent - true) / true.max(axis=1, keepdims=True))[:, seen]
    assert np.all(np.sqrt((difference**2).mean(axis=1)) > 0.02)


def test_shipped_curves_peak_where_the_camera_does() -> None:
    peaks_nm = WAVELENGTH_NM[measured_curves().sensitivity.argmax(axis=1)]
    assert peaks_nm == pytest.approx([600, 520, 460], abs=15)


def test_a_camera_of_another_laboratory(tmp_path: Path) -> None:
    curves = {str(nm): [max(0.0, 1 - abs(nm - peak) / 90) for peak in (610, 540, 450)]
              for nm in range(400, 701, 10)}  # fmt: skip
    path = tmp_path / "own.json"
    path.write_text(json.dumps({"spectral_data": {"data": {"main": curves}}}))
    own = measured_curves(str(path)).sensitivity
    assert WAVELENGTH_NM[own.argmax(axis=1)] == pytest.approx([610, 540, 450], abs=3)
    assert not own[:, WAVELENGTH_NM > 700].any(), "not measured there"
    path.write_text('{"spectral_data": {"data": {"main": {"400": [1, 2]}}}}')
    with pytest.raises(UsageError, match="expected camera curves in rawtoaces' format"):
        measured_curves(str(path))


@pytest.mark.parametrize("name", ["blue-paint", "red-paint", "yellow-paint"])
def test_bands_are_joined_smoothly_and_keep_their_means(name: str) -> None:
    material = read_material(name)
    assert material.bands_nm is not None
    cells = band_cells(material.bands_nm)
    for spectrum, state in zip(emission(material), material.states, strict=True):
        assert state.reradiation is not None
        means = cells @ spectrum / cells.sum(axis=1)
        # A cell's value is its middle's, not its mean.
        assert means == pytest.approx(state.reradiation, rel=2e-3, abs=2e-3)
        assert spectrum.min() >= 0
        assert not spectrum[WAVELENGTH_NM > 705].any()
        assert np.abs(np.diff(spectrum)).max() < 0.2 * spectrum.max()


def test_a_spectrum_gives_the_shape_and_the_bands_the_size() -> None:
    material = read_material("double-wide")
    assert material.bands_nm is not None
    fine = emission(material)
    cells = band_cells(material.bands_nm)
    for spectrum, state in zip(fine, material.states, strict=True):
        assert (cells @ spectrum).sum() * CELL_NM / 37.5 == pytest.approx(
            sum(state.reradiation or ()), rel=1e-6
        )
        assert WAVELENGTH_NM[spectrum.argmax()] == pytest.approx(520, abs=5)


def test_electrons_count_light_through_the_aperture() -> None:
    flat = CameraCurves(np.ones((3, len(WAVELENGTH_NM))))
    line = np.zeros(len(WAVELENGTH_NM))
    line[50] = 2.0
    at_4, at_8 = flat.glow_electrons_per_s(line, 4.0), flat.glow_electrons_per_s(line, 8.0)
    assert at_4 == pytest.approx(4 * at_8)


def test_a_material_that_cannot_glow_is_refused() -> None:
    fitted = Material(name="fitted", kind="phosphor", states=(State(k_r_per_s=0.1),))
    with pytest.raises(UsageError, match="fitted: expected 'bands_nm' and 'reradiation'"):
        emission(fitted)


def test_vignetting_is_a_gentle_falloff() -> None:
    falloff = vignetting(64, 96)
    assert falloff[31:33, 47:49] == pytest.approx(1.0, abs=1e-3)
    assert falloff.min() == falloff[0, 0] == pytest.approx(0.85, abs=0.01)
