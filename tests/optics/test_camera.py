"""Camera curves: what comes in, what is refused, and that white is white."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from labrig.foundation.errors import UsageError
from labrig.optics import CameraResponse, read_camera

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


def test_a_file_is_read_sorted_and_normalised(tmp_path: Path) -> None:
    path = tmp_path / "one.json"
    path.write_text(json.dumps(rawtoaces(GOOD)), encoding="utf-8")
    camera = read_camera(path)
    assert camera.name == "Acme One"
    np.testing.assert_array_equal(camera.wavelength_nm, [450, 500, 550, 600])
    np.testing.assert_allclose(camera.sensitivity[1], [0.05, 1.0, 0.15])


def test_a_misspelt_name_gets_a_hint() -> None:
    with pytest.raises(UsageError, match=f"did you mean '{NAME}'"):
        read_camera("canon_eos_5d_mrk_ii")


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("{", "not JSON"),
        ("[]", "'spectral_data' is missing"),
        (json.dumps({"spectral_data": {"data": {}}}), "'main' is missing"),
        (json.dumps(rawtoaces({})), "fewer than two"),
        (json.dumps(rawtoaces({**GOOD, "650": [1.0, 2.0]})), "not a number"),
        (json.dumps(rawtoaces({k: [1.0, 2.0] for k in GOOD})), "not one value for every name"),
        (json.dumps(rawtoaces({**GOOD, "red": [1.0, 2.0, 3.0]})), "not a number"),
        (json.dumps(rawtoaces({**GOOD, "650": [1.0, None, 3.0]})), "infinite or NaN"),
        (json.dumps(rawtoaces({**GOOD, "600.0": [1.0, 2.0, 3.0]})), "stands twice"),
        (json.dumps(rawtoaces({**GOOD, "650": [-9.0, 2.0, 3.0]})), "negative"),
        (json.dumps(rawtoaces({k: [v[0], v[0], v[2]] for k, v in GOOD.items()})), "the same"),
        (
            json.dumps(
                {"spectral_data": {"index": {"main": ["X", "Y", "Z"]}, "data": {"main": GOOD}}}
            ),
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
    with pytest.raises(UsageError, match="no such camera file"):
        read_camera(tmp_path / "none.json")


def test_sigma_of_curves_is_read_beside_them(tmp_path: Path) -> None:
    path = tmp_path / "curves.csv"
    head = "wavelength_nm,R,G,B,R_sigma,G_sigma,B_sigma"
    rows = ["450,0.0,0.2,1.0,0.01,0.02,0.1", "550,0.4,2.0,0.3,0.02,0.1,0.02", "600,0.8,0.5,0,0,0,0"]
    path.write_text("\n".join(["#Camera: Acme One", head, *rows]), encoding="utf-8")
    camera = read_camera(path)
    assert camera.name == "Acme One"
    assert camera.sigma is not None
    np.testing.assert_allclose(camera.sigma[0], [0.005, 0.01, 0.05])
    assert read_camera(NAME).sigma is None
    path.write_text(path.read_text().replace("0.1,0.02\n", "-0.1,0.02\n"), encoding="utf-8")
    with pytest.raises(UsageError, match="some σ is negative") as caught:
        read_camera(path)
    assert "\n" not in str(caught.value)


def test_a_signal_is_an_integral_over_wavelength_whatever_the_grid() -> None:
    coarse = np.array([400.0, 410.0, 420.0, 440.0, 480.0, 560.0, 720.0])
    fine = np.linspace(400.0, 720.0, 2000)
    signals = []
    for nm in (coarse, fine):
        curves = np.stack([(nm - 300) / 500, np.ones_like(nm)], axis=1)
        camera = CameraResponse("linear", nm, curves, ("R", "G"))
        signals.append(camera.response(nm / 500))
    expected = [
        (720**3 - 400**3) / 3 / 250_000 - 300 * (720**2 - 400**2) / 2 / 250_000,
        (720**2 - 400**2) / 1000,
    ]
    np.testing.assert_allclose(signals[1], expected, rtol=1e-6)
    np.testing.assert_allclose(signals[0], expected, rtol=0.02)
