"""A re-radiation matrix from hyperspectral images: truth, σ, and bad input in one line."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from labrig.analyse import CubeList, matrix_from_cubes
from labrig.material import ReradiationMatrix, read_any_material, read_reradiation
from labrig.results import DirectColumns
from tests.conftest import Ended
from tests.quick_yaml import read_quickly, write_quickly

Labrig = Callable[..., Ended]
NM = np.arange(396.0, 800.0, 3.0)
PEAKS = (420, 450, 480, 520, 560, 610)
SIDE = 16
#: Noise of a pixel, and the relative scatter of its brightness by texture.
NOISE, TEXTURE = 2e-3, 0.05


def light(peak_nm: float) -> np.ndarray[Any, Any]:
    """A band with one wing longer than the other."""
    width = np.where(peak_nm > NM, 6.0, 9.0)
    return np.asarray(1 / np.cosh((NM - peak_nm) / width) ** 2)


def emission() -> np.ndarray[Any, Any]:
    """A skewed emission, per nm, with an integral of 1."""
    shape = np.exp(-(np.log1p(np.maximum((NM - 500) / 60, -0.999)) ** 2) / 0.18)
    return np.asarray(shape * (NM > 500) / (shape[NM > 500].sum() * 3.0))


def excitation(nm: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    return np.asarray(0.35 * np.exp(-(((nm - 455) / 45) ** 2)) * (nm < 500))


REFLECTANCE = 0.3 + 0.2 * np.tanh((NM - 540) / 60)


def sample(of: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    absorbed = float((excitation(NM) * of).sum() * 3.0)
    return np.asarray(REFLECTANCE * of + absorbed * emission())


def pixels(
    spectrum: np.ndarray[Any, Any], rng: np.random.Generator, offset: float = 0.02
) -> np.ndarray[Any, Any]:
    brightness = 1 + TEXTURE * rng.standard_normal((SIDE, SIDE, 1))
    noise = NOISE * rng.standard_normal((SIDE, SIDE, len(NM)))
    return np.asarray(offset + brightness * spectrum + noise)


def write_cubes(folder: Path, seed: int, **changes: Any) -> Path:
    """Write images of the sample, above a white of 0.9 in the same image, and their list."""
    rng = np.random.default_rng(seed)
    nothing = np.zeros_like(NM)
    dark = np.concatenate([pixels(nothing, rng), pixels(nothing, rng)])
    np.savez(folder / "dark.npz", wavelength_nm=NM, values=dark)
    for peak in PEAKS:
        both = np.concatenate([pixels(sample(light(peak)), rng), pixels(0.9 * light(peak), rng)])
        np.savez(folder / f"{peak}.npz", wavelength_nm=NM, values=both)
    content = {
        "name": "orange felt",
        "region": [0, 0, SIDE, SIDE],
        "white_region": [0, SIDE, SIDE, SIDE],
        "white_reflectance": 0.9,
        "dark": "dark.npz",
        "lights": [{"name": f"{peak} nm", "cube": f"{peak}.npz"} for peak in PEAKS],
    } | changes
    path = folder / "felt.yaml"
    path.write_text(write_quickly({key: value for key, value in content.items() if value}))
    return path


def columns_of(path: Path) -> DirectColumns:
    return matrix_from_cubes(
        CubeList.model_validate(read_quickly(path.read_text(encoding="utf-8"))), path
    )[0]


def true_columns(output_nm: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Light that comes back in bands of 10 nm over the light, by sums in steps of 0.25 nm."""
    fine = np.arange(NM[0], NM[-1], 0.25) + 0.125  # middles of the steps
    columns = []
    for peak in PEAKS:
        back = np.interp(fine, NM, sample(light(peak)))
        power = np.interp(fine, NM, light(peak)).sum()
        band = [back[(fine >= nm - 5) & (fine < nm + 5)].sum() / power for nm in output_nm]
        columns.append(band)
    return np.array(columns).T


def test_columns_are_those_of_the_truth_and_sigma_is_honest(tmp_path: Path) -> None:
    of_all = []
    for seed in range(12):
        columns = columns_of(write_cubes(tmp_path, seed))
        inner = (columns.output_nm > 405) & (columns.output_nm < 775)
        truth = true_columns(columns.output_nm)
        of_all.append(((columns.column - truth) / columns.column_sigma)[inner])
    assert columns.input_nm == pytest.approx(PEAKS, abs=2.5)
    # Of many entries and seeds: errors in a column are common in part, since pixels are textured.
    assert np.sqrt(np.mean(np.square(of_all))) == pytest.approx(1.0, abs=0.14)


@pytest.mark.parametrize("ending", [".csv", ".yaml"])
def test_images_become_a_matrix_file_with_sigma(
    labrig: Labrig, tmp_path: Path, ending: str
) -> None:
    out = tmp_path / f"felt{ending}"
    ended = labrig("material", "from-cubes", write_cubes(tmp_path, 3), out)
    assert ended.code == 0, ended.err
    matrix = read_any_material(out)
    assert isinstance(matrix, ReradiationMatrix)
    assert matrix.reradiation_sigma is not None
    place = int(np.argmin(abs(matrix.input_nm - 450)))
    told = matrix.reradiated_fraction[place]
    assert told == pytest.approx(float(excitation(np.array([450.0]))[0]), abs=0.02)
    band = int(np.argmin(abs(matrix.output_nm - 520)))
    assert matrix.reflectance[band] == pytest.approx(np.interp(520, NM, REFLECTANCE), abs=0.03)


def test_white_images_of_their_own_and_lights_as_bands(labrig: Labrig, tmp_path: Path) -> None:
    path = write_cubes(tmp_path, 4)
    lights = []
    for peak in PEAKS:
        cube = np.load(tmp_path / f"{peak}.npz")["values"]
        np.savez(tmp_path / f"white-{peak}.npz", wavelength_nm=NM, values=cube[SIDE:])
        np.savez(tmp_path / f"cloth-{peak}.npz", wavelength_nm=NM, values=cube[:SIDE])
        lights.append(
            {"name": f"{peak}", "cube": f"cloth-{peak}.npz", "white": f"white-{peak}.npz"}
        )
    content = read_quickly(path.read_text()) | {"lights": lights, "white_region": None}
    del content["dark"]
    np.savez(tmp_path / "dark-one.npz", wavelength_nm=NM, values=np.full((SIDE, SIDE, 135), 0.02))
    path.write_text(write_quickly(content | {"dark": "dark-one.npz"}))
    out = tmp_path / "felt.csv"
    assert labrig("material", "from-cubes", path, out, "--lights-only").code == 0
    assert len(read_reradiation(out).input_nm) == len(PEAKS)


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"white_region": None}, "white_region"),
        ({"region": [0, 0, 4, 4]}, "100 pixels or more"),
        ({"region": [0, 0, 99, 99]}, "leaves the frame"),
        ({"white_reflectance": "./none.csv"}, "none.csv"),
        ({"dark": "nothing.npz"}, "no such file"),
        ({"lights": [{"name": "a", "cube": "420.npz"}] * 2}, "name of its own"),
        ({"white_region": [0, 0, SIDE, SIDE], "dark": "450.npz",
          "lights": [{"name": n, "cube": "450.npz"} for n in "ab"]}, "light"),
        ({"lights": [{"name": n, "cube": "450.npz"} for n in "ab"]}, "two of the same"),
        ({"regoin": 1}, "regoin"),
    ],
)  # fmt: skip
def test_bad_input_is_answered_in_one_line(
    labrig: Labrig, tmp_path: Path, changes: dict[str, Any], told: str
) -> None:
    ended = labrig(
        "material", "from-cubes", write_cubes(tmp_path, 1, **changes), tmp_path / "x.csv"
    )
    assert ended.code in (2, 3, 4), ended.err
    assert told in ended.err
    assert len(ended.err.strip().splitlines()) == 1
