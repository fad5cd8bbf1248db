"""Files of measured curves: what comes in, what is refused in one line."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st

from labrig.foundation.errors import UsageError
from labrig.optics import (
    Spectrum,
    Transmittance,
    read_camera,
    read_curve_file,
    read_monochrome_camera,
    read_spectrum,
    read_transmittance,
)

WIDE = "wavelength_nm,red,blue\n400,0,1\n500,0.5,0.5\n600,1,0\n"


def write(folder: Path, text: str, name: str = "curves.csv") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_a_table_with_a_column_a_curve(tmp_path: Path) -> None:
    path = write(tmp_path, WIDE)
    assert list(read_curve_file(path).curves) == ["red", "blue"]
    np.testing.assert_array_equal(read_spectrum(path, "blue").value, [1.0, 0.5, 0.0])


def test_a_table_with_sigma(tmp_path: Path) -> None:
    path = write(tmp_path, "wavelength_nm,value,sigma\n500,2,0.2\n400,1,0.1\n")
    lamp = read_spectrum(path)
    assert lamp.name == "curves"
    np.testing.assert_array_equal(lamp.wavelength_nm, [400, 500])
    assert lamp.sigma is not None
    np.testing.assert_array_equal(lamp.sigma, [0.1, 0.2])


def test_curves_one_below_the_other(tmp_path: Path) -> None:
    path = write(tmp_path, "name,wavelength_nm,t\na,400,0.1\na,500,0.2\nb,450,0.3\nb,460,0.4\n")
    np.testing.assert_array_equal(read_transmittance(path, "b").wavelength_nm, [450, 460])


def test_a_camera_of_ones_own(tmp_path: Path) -> None:
    text = "#Camera:Acme One\n400,0,0.1,1\n500,0.2,2,0.2\n600,1,0.1,0\n"
    camera = read_camera(write(tmp_path, text))
    assert camera.name == "Acme One"
    np.testing.assert_allclose(camera.sensitivity[1], [0.1, 1.0, 0.1])
    grey = write(tmp_path, "wavelength_nm,value\n400,1\n500,4\n600,2\n", "grey.csv")
    mono = read_monochrome_camera(grey)
    assert mono.sensitivity.shape == (3, 1)
    assert mono.channels == ("L",)
    with pytest.raises(UsageError, match="expected the channels R, G and B"):
        read_camera(grey)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "nothing in it"),
        ("# only\n", "nothing in it"),
        ("time,a\n400,1\n500,2\n", "expected a column of wavelengths, got 'time'"),
        ("colour,a\n400,1\n500,2\n", "expected a column of wavelengths"),
        ("400,1,2\n500,1,2\n", "got 3 columns"),
        ("wavelength_nm,a,a\n400,1,2\n500,1,2\n", "'a' stands twice"),
        ("wavelength_nm,a\n400,1\n500\n", "row 3 has 1 columns"),
        ("wavelength_nm,a\n400,1\n500,x\n", "not a number"),
        ("wavelength_nm,a\n400,1\n400,2\n", "stands twice"),
        ("wavelength_nm,a\n400,1\n", "two or more wavelengths"),
        ("wavelength_nm,a\n", "no rows of numbers"),
        ("wavelength_nm,a\n400,1\n500,nan\n", "infinite or NaN"),
        ("wavelength_nm,a\n0.4,1\n0.5,1\n", "from 100 to 20000 nm"),
        ("wavelength_nm,value,sigma\n400,1,1\n500,1,-1\n", "σ is negative"),
    ],
)
def test_a_bad_table_is_one_line(tmp_path: Path, text: str, said: str) -> None:
    path = write(tmp_path, text)
    with pytest.raises(UsageError, match=said) as caught:
        read_spectrum(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "said"),
    [(None, "2 .red, blue.; name one"), ("rde", "did you mean 'red'"), ("x", "known: blue, red")],
)
def test_a_curve_that_is_not_there(tmp_path: Path, name: str | None, said: str) -> None:
    with pytest.raises(UsageError, match=said):
        read_spectrum(write(tmp_path, WIDE), name)


def test_per_cent_is_no_fraction(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="divide per cent by 100"):
        read_transmittance(write(tmp_path, "wavelength_nm,value\n400,30\n500,40\n"))


@given(content=st.binary(max_size=80), suffix=st.sampled_from([".csv", ".json", ".dat"]))
def test_any_bytes_are_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, content: bytes, suffix: str
) -> None:
    path = tmp_path_factory.mktemp("any") / f"file{suffix}"
    path.write_bytes(content)
    try:
        read_spectrum(path)
    except UsageError as error:
        assert "\n" not in str(error)


#: Files of the three folders that are no curves, and what is said of them.
REFUSED = {
    "camera.dat": "got 3 columns",
    "diode.dat": "got one column",
    "info.txt": "expected a column of wavelengths",
    "hgar.arc": "columns",
    "json_schema.json": "'spectral_data' is missing",
} | {f"spectral_sensor_{p}pct.csv": "expected a column of wavelengths" for p in (5, 30, 90, 100)}


@pytest.mark.parametrize(("folder", "curves"), [("lightlogger", 4 * 41), ("rawtoaces", 1)])
def test_lights_of_the_repository_are_read(real_data: Path, folder: str, curves: int) -> None:
    paths = [*(real_data / folder).glob("jeti_*.csv"), *(real_data / folder).glob("*.json")]
    files = [read_curve_file(path) for path in paths]
    assert sum(len(file.curves) for file in files) == curves


def test_every_real_file_is_read_or_refused(shared_data: Path) -> None:
    for folder, curves in {"camera_sensitivity": 303, "light_sources": 422, "filters": 827}.items():
        assert_read_or_refused(shared_data, folder, curves)


def assert_read_or_refused(shared_data: Path, folder: str, curves: int) -> None:
    read = 0
    for path in sorted(p for p in (shared_data / folder).rglob("*") if p.is_file()):
        if path.name in REFUSED:
            with pytest.raises(UsageError, match=REFUSED[path.name]):
                read_curve_file(path)
            continue
        file = read_curve_file(path)
        for name, curve in file.curves.items():
            (Transmittance if folder == "filters" else Spectrum)(name, *curve)
            read += 1
        if set(file.curves) == {"R", "G", "B"}:
            assert read_camera(path).sensitivity.max() == 1.0
    assert read == curves
