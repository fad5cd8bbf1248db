"""A mixture's file as a material of a scene."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from labrig.fit import fit_mixture
from labrig.foundation.errors import DataError, LabrigError, UsageError
from labrig.material import (
    ReradiationMixture,
    corrected,
    read_fluorescent,
    read_mixture,
    read_reradiation,
    with_sigma,
    write_reradiation,
)
from labrig.optics import delta_e, illuminant, lab
from labrig.reproduce import Bands, Renderer, of_matrix, of_mixture, tristimulus
from tests.reproduce.dyes import DYE, INPUT_NM, OUTPUT_NM
from tests.reproduce.small_scenes import scene
from tests.warned import of_code


def written(folder: Path, dye: ReradiationMixture = DYE, **changed: Any) -> Path:
    """Write the file of a mixture that is fitted to the matrix of one."""
    matrix = dye.to_matrix(INPUT_NM, OUTPUT_NM, reflectance=np.full(len(OUTPUT_NM), 0.4))
    content = fit_mixture(matrix, len(dye.weights), threshold=1e-9).to_dict()
    path = folder / "fit.json"
    path.write_text(json.dumps({**content, **changed}))
    return path


def test_a_mixture_in_the_bands_has_the_integral_of_its_density(tmp_path: Path) -> None:
    bands = Bands.even()
    surface = of_mixture("dye", read_mixture(written(tmp_path)), 0.4, bands)
    fine_nm = np.arange(300.5, 780.0)
    density = DYE.reradiation(fine_nm, fine_nm[:, np.newaxis])
    into = np.kron(np.eye(24), np.full((1, 20), 1 / 20))
    expected = into @ density @ np.kron(np.eye(24), np.ones((20, 1)))
    np.fill_diagonal(expected, 0.4)
    # Numbers at the centres of bands of 10 nm are not quite their means.
    off_diagonal = expected - 0.4 * np.eye(24)
    np.testing.assert_allclose(surface.matrix, expected, rtol=0, atol=0.015 * off_diagonal.max())
    assert off_diagonal.sum(axis=0).max() > 0.1
    assert not surface.is_diagonal


def test_a_scene_shows_a_mixture_like_the_matrix_that_it_stands_for(tmp_path: Path) -> None:
    written(tmp_path)
    matrix = DYE.to_matrix(
        INPUT_NM, OUTPUT_NM, reflectance=np.linspace(0.3, 0.5, len(OUTPUT_NM)), name="dye"
    )
    write_reradiation(tmp_path / "dye.csv", matrix)
    seen = {}
    for name, entry in {
        "matrix": {"file": "dye.csv"},
        "mixture": {"file": "dye.csv", "mixture": "fit.json"},
        "grey": {"albedo": 0.4, "mixture": "fit.json"},
        "reflected": {"file": "dye.csv", "mixture": "fit.json", "is_fluorescent": False},
    }.items():
        frame = next(Renderer(scene(tmp_path, materials={"paint": entry})).frames())
        seen[name] = frame.radiance.mean(axis=(0, 1))
    np.testing.assert_allclose(seen["mixture"], seen["matrix"], rtol=1e-4)
    dye = seen["mixture"] - seen["reflected"]
    np.testing.assert_allclose(seen["grey"] - 0.4 * seen["reflected"] / _reflectance(), dye,
                               rtol=1e-3, atol=1e-3 * dye.max())  # fmt: skip
    assert dye.sum() > 0.08 * seen["reflected"].sum()


def _reflectance() -> np.ndarray[Any, Any]:
    """Return the reflectance from 0.3 to 0.5 of the test above in the bands of a scene."""
    nm = np.arange(300.25, 780, 0.5)
    fine = np.interp(nm, OUTPUT_NM, np.linspace(0.3, 0.5, len(OUTPUT_NM)))
    return np.asarray(fine.reshape(24, -1).mean(axis=1))


def test_light_that_was_not_measured_is_not_shifted(tmp_path: Path) -> None:
    path = written(tmp_path, measured_input_nm=[380.0, 780.0])
    surface = of_mixture("dye", read_mixture(path), 0.0, Bands.even())
    assert surface.matrix[:, :4].max() == 0
    assert surface.matrix[:, 4].sum() > 0.1


def test_a_measured_material_keeps_its_colour_by_a_mixture(tmp_path: Path) -> None:
    textile = read_fluorescent("config/fluorescent/yellow-textile.yaml")
    (tmp_path / "fit.json").write_text(fit_mixture(textile, 4, threshold=1e-3).to_json())
    by_mixture = of_mixture("textile", read_mixture(tmp_path / "fit.json"), textile, Bands.even())
    whole, light = of_matrix(textile, Bands.even()), Bands.even().means(illuminant("D65"))
    difference = (by_mixture.matrix - whole.matrix) @ light
    assert np.abs(difference).max() < 0.02 * (whole.matrix @ light).max()


@pytest.mark.parametrize(
    ("entry", "changed", "says"),
    [
        ({"mixture": "fit.json"}, {}, "'file'"),
        ({"mixture": "none.json", "albedo": 0.4}, {}, "none.json"),
        ({"mixture": "fit.json", "file": "blue-paint"}, {}, "phosphor"),
        ({"mixture": "fit.json", "albedo": 0.4}, {"unit": "relative"}, "relative"),
        ({"mixture": "fit.json", "albedo": 0.4}, {"components": []}, "mixture"),
        ({"mixture": "fit.json", "albedo": 0.4}, {"band_nm": 1e-9}, "bands"),
        ({"mixture": "fit.json", "albedo": 0.4}, {"measured_input_nm": [790, 900]}, "overlap"),
        ({"mixture": "fit.json", "albedo": 0.8}, {"scale": 1500.0}, "comes? back"),
    ],
)
def test_a_mixture_that_does_not_fit_is_one_line(
    tmp_path: Path, entry: dict[str, Any], changed: dict[str, Any], says: str
) -> None:
    written(tmp_path, **changed)
    with pytest.raises((UsageError, DataError, ValueError), match=says) as raised:
        scene(tmp_path, materials={"paint": entry})
    if isinstance(raised.value, LabrigError):
        assert "\n" not in str(raised.value)


def test_noise_that_takes_light_away_is_told() -> None:
    """A mixture of the same matrix has none."""
    matrix = DYE.to_matrix(INPUT_NM, OUTPUT_NM, reflectance=np.full(len(OUTPUT_NM), 0.4))
    assert of_matrix(matrix, Bands.even()).notes == ()
    for noise, is_reported in ((1e-5, False), (5e-4, True)):
        rng = np.random.default_rng(3)
        noisy = replace(
            matrix, reradiation=matrix.reradiation + rng.normal(0, noise, matrix.reradiation.shape)
        )
        surface = of_matrix(noisy, Bands.even())
        lowest = (surface.matrix - 0.4 * np.eye(24)).min()
        assert len(surface.notes) == is_reported
        if is_reported:
            negative = of_code(surface.notes, "reradiation-negative")
            assert negative.values["fraction"] == pytest.approx(-lowest, rel=1e-4)
    with pytest.raises(UsageError, match="≥ 0"):
        of_matrix(replace(matrix, reradiation=matrix.reradiation - 0.003), Bands.even())


def test_measured_textiles_keep_their_colours_by_a_mixture(
    shared_data: Path, tmp_path: Path
) -> None:
    """Under D65 and A, in the bands of a scene; on the bands of the fit, not on finer ones."""
    bands = Bands.even()
    for name in ("TEXTYELL", "POLYYELL"):
        path = shared_data / f"bispectral/rit_bfc450/{name}.BFC"
        measured = with_sigma(corrected(read_reradiation(path)))
        (tmp_path / "fit.json").write_text(fit_mixture(measured, 4).to_json())
        surfaces = (
            of_mixture(name, read_mixture(tmp_path / "fit.json"), measured, bands),
            of_matrix(measured, bands),
        )
        for light in ("D65", "A"):
            power = bands.means(illuminant(light))
            white = tristimulus(power, bands.edges_nm)
            found, expected = (
                lab(tristimulus(each.matrix @ power, bands.edges_nm) / white[1], white / white[1])
                for each in surfaces
            )
            assert delta_e(found, expected) < 1.05
