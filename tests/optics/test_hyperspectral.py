"""Hyperspectral images: ENVI in all its layouts, arrays, bad files in one line; their columns."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

from labrig.fit.bispectral import IlluminatedSpectrum, bispectral_columns, separate_columns
from labrig.foundation.errors import DataError, LabrigError, UsageError
from labrig.optics import HyperspectralCube, Spectrum, read_hyperspectral_cube

NM = np.arange(380.0, 781.0, 4.0)
ORDER = {"bsq": (2, 0, 1), "bil": (0, 2, 1), "bip": (0, 1, 2)}


def envi(folder: Path, values: np.ndarray[Any, Any], interleave: str, **keys: str) -> Path:
    lines, samples, bands = values.shape
    kinds = {"float32": "4", "uint16": "12", "int16": "2", "float64": "5"}
    header = {
        "samples": samples, "lines": lines, "bands": bands, "header offset": 0,
        "data type": kinds[values.dtype.newbyteorder("=").name], "interleave": interleave,
        "byte order": int(values.dtype.byteorder == ">"), "wavelength units": "Nanometers",
        "wavelength": "{" + ",\n ".join(str(400 + 10 * band) for band in range(bands)) + "}",
    } | {key.replace("_", " "): value for key, value in keys.items()}  # fmt: skip
    path = folder / "cloth.hdr"
    text = "\n".join(f"{key} = {value}" for key, value in header.items() if value is not None)
    path.write_text(f"ENVI\ndescription = {{a cloth}}\n{text}\n")
    (folder / "cloth.raw").write_bytes(values.transpose(ORDER[interleave.lower()]).tobytes())
    return path


@pytest.mark.parametrize("interleave", ["bsq", "bil", "BIP"])
@pytest.mark.parametrize("kind", ["<f4", "<u2", ">u2", ">f8"])
def test_every_layout_of_envi_is_the_same_image(tmp_path: Path, interleave: str, kind: str) -> None:
    values = np.arange(3 * 4 * 5).reshape(3, 4, 5).astype(kind)
    cube = read_hyperspectral_cube(envi(tmp_path, values, interleave))
    assert np.array_equal(cube.values, values)
    assert cube.wavelength_nm.tolist() == [400, 410, 420, 430, 440]
    assert cube.spectrum((0, 0, 4, 3)).value == pytest.approx(values.mean(axis=(0, 1)))


def test_arrays_are_read_too(tmp_path: Path) -> None:
    values = np.ones((2, 3, 2), np.float32)
    np.save(tmp_path / "a.npy", values)
    with pytest.raises(UsageError, match=r"wavelengths in the file .*a\.csv"):
        read_hyperspectral_cube(tmp_path / "a.npy")
    (tmp_path / "a.csv").write_text("wavelength_nm\n400\n500\n")
    assert read_hyperspectral_cube(tmp_path / "a.npy").wavelength_nm.tolist() == [400, 500]
    in_um = envi(tmp_path, values, "bip", wavelength_units="Micrometers", wavelength="{0.4, 0.5}")
    assert read_hyperspectral_cube(in_um).wavelength_nm == pytest.approx([400, 500])


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"lines": "9"}, "bytes of numbers, got"),
        ({"lines": "0"}, "must be 1 or more"),
        ({"lines": "999999999"}, "more than"),
        ({"lines": "x"}, "invalid literal"),
        ({"data_type": "6"}, "data type 6"),
        ({"wavelength": "{400, 390, 420}"}, "rise"),
        ({"wavelength": "{400}"}, "but 1 wavelengths"),
        ({"wavelength_units": "GHz"}, "'ghz' are not known"),
        ({"samples": None}, "has no 'samples'"),
    ],
)
def test_a_wrong_header_is_one_clear_line(tmp_path: Path, keys: dict[str, Any], said: str) -> None:
    path = envi(tmp_path, np.ones((2, 2, 3), np.float32), "bsq", **keys)
    with pytest.raises(DataError) as caught:
        read_hyperspectral_cube(path)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_what_is_no_image_is_one_clear_line(tmp_path: Path) -> None:
    for name, content in (("a.hdr", b"no"), ("a.npz", b"PK"), ("a.npy", b"\x93NUMPY")):
        (tmp_path / name).write_bytes(content)
        (tmp_path / "a.csv").write_text("400\n500\n")
        with pytest.raises(DataError):
            read_hyperspectral_cube(tmp_path / name)
    with pytest.raises(UsageError, match="no such file"):
        read_hyperspectral_cube(tmp_path / "b.hdr")
    (tmp_path / "a.tif").write_bytes(b"")
    with pytest.raises(UsageError, match="ENVI header"):
        read_hyperspectral_cube(tmp_path / "a.tif")
    path = envi(tmp_path, np.ones((2, 2, 3), np.float32), "bsq")
    header = path.read_text()
    path.write_text(header.replace("bsq", "bxl"))
    with pytest.raises(DataError, match="interleave bxl"):
        read_hyperspectral_cube(path)
    path.write_text(header)
    (tmp_path / "cloth.raw").unlink()
    with pytest.raises(UsageError, match="numbers beside it"):
        read_hyperspectral_cube(path)


@given(text=st.text(max_size=200))
def test_any_header_is_read_or_refused(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    path = tmp_path_factory.mktemp("any") / "a.hdr"
    path.write_text(f"ENVI\nlines = 1\nsamples = 1\nbands = 2\n{text}", encoding="utf-8")
    with pytest.raises(LabrigError):
        read_hyperspectral_cube(path)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_columns_of_a_region_are_right_within_sigma(seed: int) -> None:
    """A cloth with a skewed dye under two skewed lights, one cube for each, with noise."""
    rng = np.random.default_rng(seed)
    reflectance = 0.2 + 0.5 / (1 + np.exp(-(NM - 560) / 15))
    emission = np.exp(
        -((np.log((NM - 440) / 80, where=NM > 440, out=np.full(len(NM), 9.0))) ** 2) / 0.3
    )
    emission /= np.trapezoid(emission, NM)
    output_nm = np.arange(400.0, 761.0, 10.0)
    lights: list[IlluminatedSpectrum] = []
    samples: list[IlluminatedSpectrum] = []
    truth = []
    for centre_nm, part in ((430.0, 0.3), (470.0, 0.2)):
        off_nm = NM - centre_nm
        light = np.exp(-((off_nm / np.where(off_nm < 0, 9.0, 14.0)) ** 2))
        back = reflectance * light + part * np.trapezoid(light, NM) * emission
        for kept, spectrum in ((lights, light), (samples, back)):
            clean = np.broadcast_to(spectrum, (20, 20, len(NM)))
            cube = HyperspectralCube("cloth", NM, clean + rng.normal(0, 0.01, clean.shape))
            kept.append(IlluminatedSpectrum.of(cube.spectrum((0, 0, 20, 20))))
        power = np.trapezoid(light, NM)
        truth.append(
            Spectrum("back", NM, back / power).in_bands(np.arange(395.0, 766.0, 10.0)) * 10
        )
    columns = bispectral_columns(lights, samples, output_nm)
    error = (columns.column - np.array(truth).T) / columns.column_sigma
    assert 0.75 < np.sqrt(np.mean(error**2)) < 1.3
    clear = separate_columns(columns).reradiated[(output_nm > 540)]
    expected = np.interp(output_nm[output_nm > 540], NM, emission) * 10
    assert clear == pytest.approx(expected[:, np.newaxis] * [0.3, 0.2], abs=0.004)
