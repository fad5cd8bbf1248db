"""The written material, rendered as a field of samples, glows as was wished for."""

from pathlib import Path

import numpy as np
import pytest

from labrig.design import (
    RGB_TO_Y,
    Conversion,
    Design,
    Keys,
    LightProgramme,
    key_differences,
    solve,
    spectral_bands,
    three_bands,
    to_material,
    written_differences,
)
from labrig.foundation.errors import DataError
from labrig.material import read_material, write_material
from labrig.reproduce import Field, FieldParameters
from tests.design.scenes import COLOURED, Truth, keys_of

THREE = three_bands()
DAY = LightProgramme.checked(
    [0.0, 30.0, 90.0, 95.0], [[1.0, 0.9, 0.8], [0.0] * 3, [0.7, 0.8, 1.3], [0.0] * 3]
)
TIMES_S = [31.0, 50.0, 80.0, 93.0, 97.0, 150.0]


def differences(wanted: np.ndarray, got: np.ndarray) -> np.ndarray:
    return key_differences(wanted, got, wanted @ RGB_TO_Y)


def glow(design: Design, path: Path) -> np.ndarray:
    """Linear sRGB of the field of a written material at the keys, reflection included."""
    write_material(path, to_material(design, "made"))
    material = read_material(path)
    conversion = Conversion.to(design.bands, material.bands_nm or ())
    lights = conversion.light(design.programme.irradiance[0])
    mean = float(lights[np.linalg.norm(lights, axis=1).argmax()].mean())
    assert material.irradiance_norm is not None
    assert material.albedo is not None
    strongest = float(np.linalg.norm(lights, axis=1).max())
    assert material.irradiance_norm.value == pytest.approx(strongest / mean, rel=1e-5)
    field = Field(FieldParameters.of(material), 1)
    found, now = [], float(design.programme.begin_s[0])
    ends = np.append(design.programme.begin_s[1:], np.inf)
    for time in design.keys.time_s.tolist():
        while now < time:
            number = int(np.searchsorted(design.programme.begin_s, now, "right")) - 1
            end = min(time, float(ends[number]))
            field.step(lights[number] / mean, end - now)
            now = end
        number = int(np.searchsorted(design.programme.begin_s, time, "right")) - 1
        back = np.array(material.albedo.value) * lights[number] / np.pi
        radiance = mean * field.radiance()[:, 0] + back
        found.append(conversion.to_rgb @ radiance)
    return np.array(found)


@pytest.mark.parametrize("n_states", [1, 2])
def test_three_channels_become_spectra_that_look_the_same(tmp_path: Path, n_states: int) -> None:
    truth = Truth.of([0.2, 0.01], [[0.004, 0.02, 0.1], [0.001, 0.01, 0.05]],
                     [[0.002, 0.04, 0.1], [0.1, 0.4, 0.06]], [0.5, 0.3, 0.2])  # fmt: skip
    keys = keys_of(truth, DAY, TIMES_S)
    design = solve(DAY, keys, THREE, n_states=n_states, energy="kept")
    rendered = glow(design, tmp_path / "made.yaml")
    difference = differences(design.got_rgb, rendered)
    assert difference.max() < 2
    if n_states == 2:
        assert differences(design.keys.radiance, rendered).max() < 2


def test_spectral_bands_are_written_as_they_are(tmp_path: Path) -> None:
    bands = spectral_bands([400.0, 480.0, 560.0, 700.0])
    truth = Truth.of([0.05], [[0.002, 0.03, 0.2]], [[0.1, 0.4, 0.2]], [0.1, 0.3, 0.2])
    light = COLOURED.irradiance[0]
    radiance = truth.radiance(COLOURED, 0, [6.0, 30.0, 80.0, 130.0]) @ bands.to_rgb.T
    keys = Keys.checked(0, [6.0, 30.0, 80.0, 130.0], radiance)
    design = solve(COLOURED, keys, bands, albedo=[0.1, 0.3, 0.2])
    material = to_material(design, "made")
    mean = float(light[np.linalg.norm(light, axis=1).argmax()].mean())
    np.testing.assert_allclose(material.states[0].k_e_per_s or (), design.k_e_per_s[0] * mean, 1e-5)
    np.testing.assert_allclose(glow(design, tmp_path / "m.yaml"), design.got_rgb, rtol=2e-3)


def test_under_coloured_light_the_difference_of_spectra_and_channels_is_told(
    tmp_path: Path,
) -> None:
    light = LightProgramme.checked(
        [0.0, 30.0, 60.0], [[1.0, 0.9, 0.8], [0.05, 0.1, 2.0], [0.0] * 3]
    )
    truth = Truth.of([0.05], [[0.0, 0.03, 0.1]], [[0.1, 0.4, 0.2]], [0.6, 0.3, 0.2])
    design = solve(light, keys_of(truth, light, [10.0, 40.0, 61.0, 90.0]), THREE)
    rendered = differences(design.keys.radiance, glow(design, tmp_path / "m.yaml"))
    assert rendered.max() > 2 > design.delta_e2000.max()
    told = written_differences(design, read_material(tmp_path / "m.yaml"))
    np.testing.assert_allclose(told, rendered, atol=0.02)


def test_the_file_says_what_it_is() -> None:
    light = LightProgramme.checked([0.0, 60.0], [[1.0] * 3, [0.0] * 3])
    keys = Keys.checked(0, [61.0, 80.0], [[0.001, 0.01, 0.002], [0.002, 0.02, 0.004]])
    provenance = to_material(solve(light, keys, THREE, albedo=0.5), "rising").provenance
    assert provenance is not None
    assert "not measured" in provenance.source
    for part in ("smoothest", "Not determined by the wishes: ", "Not possible: ", "ΔE2000"):
        assert part in (provenance.note or "")


def test_without_light_there_is_no_material() -> None:
    dark = LightProgramme.checked([0.0], [[0.0] * 3])
    design = solve(dark, Keys.checked(0, [1.0], [[0.0, 0.0, 0.0]]), THREE)
    with pytest.raises(DataError, match="light"):
        to_material(design, "dark")


def test_what_would_never_fade_is_written_weaker() -> None:
    # In its bands it may glow with more light than it takes.
    keys = Keys.checked(0, [101.0, 160.0], [[0.0, 0.3, 0.1], [0.0, 0.1, 0.03]])
    design = solve(DAY, keys, THREE, albedo=0.5)
    assert not design.keeps_energy
    material = to_material(design, "bright")
    k_e = np.array([state.k_e_per_s for state in material.states])
    emitted = np.array([state.reradiation for state in material.states])
    among = np.pi * 2 * k_e @ emitted.T
    assert np.abs(np.linalg.eigvals(among)).max() == pytest.approx(0.99, abs=0.02)
    assert material.provenance is not None
    assert "more light than it takes" in (material.provenance.note or "")
    assert written_differences(design, material).max() > 2
