"""Camera curves: what comes in, what is refused, and that white is white."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from labrig.errors import UsageError
from labrig.optics import CameraResponse, read_camera, shipped_cameras
from labrig.optics.observer import colour_matching

NAME = "canon_eos_5d_mark_ii"


def rawtoaces(main: dict[str, Any]) -> dict[str, Any]:
    return {
        "header": {"manufacturer": "Acme", "model": "One"},
        "spectral_data": {"index": {"main": ["R", "G", "B"]}, "data": {"main": main}},
    }


GOOD = {
    "600": [0.8, 0.2, 0.0],
    "500": [0.1, 2.0, 0.3],
    "550": [0.3, 1.0, 0.1],
    "450": [0.0, 0.2, 1.0],
}


def test_the_shipped_camera_is_read() -> None:
    camera = read_camera(NAME)
    assert camera.name == "Canon EOS 5D Mark II"
    assert camera.sensitivity.shape == (81, 3)
    assert camera.sensitivity.max() == 1.0
    # Channels keep their heights relative to each other: raw numbers depend on them.
    np.testing.assert_allclose(camera.sensitivity.max(axis=0), [0.544, 1.0, 0.897], atol=1e-3)
    assert NAME in shipped_cameras()


def test_a_file_is_read_sorted_and_normalised(tmp_path: Path) -> None:
    path = tmp_path / "one.json"
    path.write_text(json.dumps(rawtoaces(GOOD)), encoding="utf-8")
    camera = read_camera(path)
    assert camera.name == "Acme One"
    np.testing.assert_array_equal(camera.wavelength_nm, [450, 500, 550, 600])
    np.testing.assert_allclose(camera.sensitivity[1], [0.05, 1.0, 0.15])


def test_a_misspelt_name_gets_a_hint() -> None:
    with pytest.raises(UsageError, match=f"did you mean '{NAME}'"):
        read_camera("canon_eos_5d_mark_iii")


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("{", "not JSON"),
        ("[]", "'spectral_data' is missing"),
        (json.dumps({"spectral_data": {"data": {}}}), "'main' is missing"),
        (json.dumps(rawtoaces({})), "fewer than three"),
        (json.dumps(rawtoaces({**GOOD, "650": [1.0, 2.0]})), "not a number"),
        (json.dumps(rawtoaces({k: [1.0, 2.0] for k in GOOD})), "not three values"),
        (json.dumps(rawtoaces({**GOOD, "red": [1.0, 2.0, 3.0]})), "not a number"),
        (json.dumps(rawtoaces({**GOOD, "650": [1.0, None, 3.0]})), "infinite or NaN"),
        (json.dumps(rawtoaces({**GOOD, "600.0": [1.0, 2.0, 3.0]})), "stands twice"),
        (json.dumps(rawtoaces({**GOOD, "650": [-9.0, 2.0, 3.0]})), "negative"),
        (json.dumps(rawtoaces({k: [v[0], v[0], v[2]] for k, v in GOOD.items()})), "the same"),
        (
            json.dumps({"spectral_data": {"index": {"main": ["L"]}, "data": {"main": GOOD}}}),
            "the channels are",
        ),
    ],
)
def test_a_malformed_file_is_one_line(tmp_path: Path, content: str, said: str) -> None:
    path = tmp_path / "bad.json"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(UsageError, match=said) as caught:
        read_camera(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no such file"):
        read_camera(tmp_path / "none.json")


def test_equal_energy_comes_out_exactly() -> None:
    camera = read_camera(NAME)
    raw = camera.response(np.ones_like(camera.wavelength_nm))
    xyz = camera.camera_to_xyz() @ (raw / raw.max())
    np.testing.assert_allclose(xyz, 1.0, atol=2e-3)


def test_an_observer_as_camera_gives_the_observer() -> None:
    wavelength_nm = np.arange(380.0, 781.0, 5.0)
    mixing = np.array([[1.0, 0.2, 0.1], [0.3, 1.0, 0.1], [0.0, 0.2, 1.0]])
    camera = CameraResponse("ideal", wavelength_nm, colour_matching(wavelength_nm) @ mixing.T)
    matrix = camera.camera_to_xyz()
    np.testing.assert_allclose(
        matrix / matrix[1, 1], np.linalg.inv(mixing) / np.linalg.inv(mixing)[1, 1], atol=1e-9
    )


def test_the_misfit_is_what_the_docstring_says() -> None:
    camera = read_camera(NAME)
    target = colour_matching(camera.wavelength_nm)
    fitted = camera.sensitivity @ camera.camera_to_xyz().T
    scale = target.sum(axis=0)[1] / fitted.sum(axis=0)[1]
    rms = np.sqrt(np.mean((fitted * scale - target) ** 2, axis=0))
    np.testing.assert_allclose(rms, [0.09, 0.09, 0.16], atol=0.01)


def test_the_observer_has_equal_areas() -> None:
    """Equal-energy white is X = Y = Z; the tables' areas are 106.86 nm each."""
    areas = colour_matching(np.arange(360.0, 831.0)).sum(axis=0)
    np.testing.assert_allclose(areas, 106.86, rtol=2e-3)
