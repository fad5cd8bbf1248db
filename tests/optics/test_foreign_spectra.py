"""Spectra as spectrometers write them: the values in them, or a line that says what is missing."""

import random
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st
from numpy.testing import assert_allclose

from labrig.foundation.errors import UsageError
from labrig.optics import read_curve_file, read_spectrum, read_transmittance
from tests.written_spectra import FRACTIONS, LIGHTS, spectrum_text


def write(folder: Path, text: str, name: str = "export.txt") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("name", "points", "nm", "absorbance"),
    [
        ("cary_absorbance.csv", 141, 899.9957886, 0.03348613903),
        ("jasco_v570.txt", 1251, 750.0, 0.78552),
    ],
)
def test_absorbance_is_a_transmittance_and_no_light(
    real_data: Path, name: str, points: int, nm: float, absorbance: float
) -> None:
    path = real_data / "wrighttools" / name
    curve = read_transmittance(path)
    assert len(curve.wavelength_nm) == points
    assert_allclose(curve.at([nm]), 10**-absorbance, rtol=1e-12)
    with pytest.raises(UsageError, match="expected a spectrum of light, got a transmittance"):
        read_spectrum(path)
    (note,) = read_curve_file(path).notes[curve.name]
    assert "10^-A" in note


def test_a_spectrum_of_counts(real_data: Path) -> None:
    path = real_data / "wrighttools/oobase32.scope"
    spectrum = read_spectrum(path)
    assert len(spectrum.wavelength_nm) == 2048
    assert spectrum.at([787.02]) == 656.6
    with pytest.raises(UsageError, match="got light"):
        read_transmittance(path)


@pytest.mark.parametrize(
    ("name", "nm", "value"),
    [("labspec_spectrum_nm.txt", 425.178, 124.32), ("shimadzu_uv.txt", 340.0, 0.1308)],
)
def test_what_nobody_says_is_named(
    real_data: Path, name: str, nm: float, value: float, caplog: pytest.LogCaptureFixture
) -> None:
    path = real_data / "wrighttools" / name
    assert read_spectrum(path).at([nm]) == value
    assert "does not state the quantity" in caplog.text
    with pytest.raises(UsageError, match="whose meaning is not stated; write above the columns"):
        read_transmittance(path)


def test_columns_of_an_instrument_and_the_names_of_samples(tmp_path: Path) -> None:
    text = (
        "Gerät;A\nInput;blue;red\nMode;Irradiance;Irradiance\n\n"
        "Wavelength [nm];Ee [W/(sqm*nm)];Ee [W/(sqm*nm)]\n"
        "380;2,5E-04;0,00E+00\n381;4,0E-04;1,0E-05\n"
    )
    path = tmp_path / "jeti.csv"
    path.write_bytes(text.encode("latin-1"))
    assert list(read_curve_file(path).curves) == ["blue", "red"]
    assert_allclose(read_spectrum(path, "blue").value, [2.5e-4, 4e-4])


def test_samples_in_pairs_of_columns_of_different_length(tmp_path: Path) -> None:
    text = (
        "one,,two,,\nWavelength (nm),Abs,Wavelength (nm),%T,\n"
        "500,1,700,50,\n400,2,600,25,\n,,500,10,\n\none\nCollection Time: 1/2/2020\n"
    )
    path = write(tmp_path, text, "cary.csv")
    assert_allclose(read_transmittance(path, "one").value, [0.01, 0.1])
    assert_allclose(read_transmittance(path, "two").value, [0.1, 0.25, 0.5])


def test_only_one_column_can_be_what_is_wanted(tmp_path: Path) -> None:
    text = (
        "Wave   ;Sample   ;Dark     ;Reference;Transmittance\n[nm]   ;[counts] ;[counts] ;[counts]"
        " ;[%]\n 400,0; 120,0; 20,0; 220,0; 50,0\n 401,0; 70,0; 20,0; 220,0; 25,0\n"
    )
    path = write(tmp_path, text, "avantes.txt")
    assert_allclose(read_transmittance(path).value, [0.5, 0.25])
    assert_allclose(read_spectrum(path, "Sample").value, [120, 70])


def test_sigma_goes_along(tmp_path: Path) -> None:
    path = write(tmp_path, "Wavelength (nm),Abs,Abs_sigma\n400,1,0.01\n500,2,0.02\n")
    sigma = read_transmittance(path).sigma
    assert sigma is not None
    assert_allclose(sigma, np.log(10) * np.array([0.1 * 0.01, 0.01 * 0.02]))


def test_rows_that_repeat_another_are_left_out_and_named(tmp_path: Path) -> None:
    path = write(tmp_path, "Frame,Row,nm,Counts\n" + "1,1,400,1\n1,1,500,2\n" * 2)
    file = read_curve_file(path)
    (curve,) = file.curves.values()
    assert curve.wavelength_nm.tolist() == [400, 500]
    assert "2 row(s)" in next(iter(file.notes.values()))[0]


def test_marks_of_no_measurement_are_left_out_and_named(tmp_path: Path) -> None:
    path = write(tmp_path, "nm,Counts\n400,1\n401,9.9e37\n402,OVER\n403,3\n")
    file = read_curve_file(path)
    (curve,) = file.curves.values()
    assert curve.wavelength_nm.tolist() == [400, 403]
    assert "9.9e37" in next(iter(file.notes.values()))[0]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("Raman shift (cm-1),Counts\n400,1\n500,2\n", "expected a column of wavelengths"),
        ("Time (s),Counts\n400,1\n500,2\n", "expected a column of wavelengths"),
        ("Frequency,Counts\n400,1\n500,2\n", "expected the unit of 'Frequency'"),
        ("Wavelength (furlong),Counts\n400,1\n500,2\n", "expected an axis in nm"),
        ("Wavelength (µm),Counts\n400,1\n500,2\n", "expected wavelengths from 100 to 20000 nm"),
        ("4000 1\n3000 2\n400 3\n", "expected the unit of the first column"),
        ("nm,Power (dBm)\n400,-1\n500,-2\n", "is in decibels"),
        ("nm,ln I\n400,1\n500,2\n", "is a logarithm"),
        ("nm,ln(1/T)\n400,1\n500,2\n", "is a logarithm"),
        ("nm,Transmittance (‰)\n400,900\n500,200\n", "other parts than per cent"),
        ("nm,Absorption coefficient (cm-1)\n400,1\n500,2\n", "neither transmittance"),
        ("nm,Absorption (%)\n400,1\n500,2\n", "neither transmittance"),
        ("nm,K/S\n400,1\n500,2\n", "Kubelka-Munk"),
        ("eV,Counts\n2,1\n3,2\n", "whether it is per nm"),
        ("nm,Transmittance\n400,1.3\n500,0.2\n", "in per cent or as a fraction"),
        ("nm,Counts\n400,1\n400,2\n", "stands twice"),
        ("nm,Counts\n400,1\n500,1x\n600,2\n", "line 3: expected a number"),
        ("NPOINTS 4\nXUNITS NM\nYUNITS COUNTS\nXYDATA\n400 1\n401 2\n", "the table is cut"),
        ("##XYDATA=(X++(Y..Y))\n400 1 2 3\n403 4 5 6\n", "packed"),
    ],
)
def test_what_could_be_wrong_is_refused(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(UsageError, match=said) as caught:
        read_spectrum(write(tmp_path, text))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("axis", "nm"),
    [
        ("Wavelength (Å)\n4000\n5000", [400.0, 500.0]),
        ("lambda_um\n0.4\n0.5", [400.0, 500.0]),
        ("Wavenumber (cm-1)\n20000\n25000", [400.0, 500.0]),
        ("Photon energy [eV]\n2.0\n2.5", [495.93679, 619.92099]),
        ("Frequency / THz\n500\n600", [499.654097, 599.584916]),
    ],
)
def test_axes_in_other_units(tmp_path: Path, axis: str, nm: list[float]) -> None:
    name, *cells = axis.split("\n")
    rows = [f"{cell};{number}" for number, cell in enumerate(cells)]
    path = write(tmp_path, "\n".join([f"{name};T (%)", *rows]))
    assert_allclose(read_transmittance(path).wavelength_nm, nm, rtol=1e-8)


def test_an_irradiance_is_per_square_metre_and_nm(tmp_path: Path) -> None:
    for axis in ("Wavelength (nm)", "wavelength_nm"):
        path = write(tmp_path, f"{axis}\tIrradiance (µW/cm²/nm)\n400\t3\n500\t5\n")
        assert_allclose(read_spectrum(path).value, [0.03, 0.05])


def test_labrigs_own_table_from_a_german_spreadsheet(tmp_path: Path) -> None:
    path = write(tmp_path, "wavelength_nm;value;sigma\n400;0,25;0,01\n500;0,5;0,01\n")
    curve = read_transmittance(path)
    assert curve.value.tolist() == [0.25, 0.5]
    assert curve.sigma is not None
    assert curve.sigma.tolist() == [0.01, 0.01]


@given(rng=st.randoms(use_true_random=False))
def test_a_transmittance_in_any_writing(
    tmp_path_factory: pytest.TempPathFactory, rng: random.Random
) -> None:
    nm = np.linspace(401.5, 699.25, 12)
    values = 0.1 + 0.8 * np.linspace(0, 1, 12) ** 2
    name, of = rng.choice(FRACTIONS)
    path = tmp_path_factory.mktemp("any") / "export.txt"
    path.write_bytes(spectrum_text(rng, nm, [(name, of(values))]))
    try:
        curve = read_transmittance(path)
    except UsageError:
        return
    assert_allclose(curve.wavelength_nm, nm, rtol=1e-7)
    assert_allclose(curve.value, values, rtol=1e-6)


@given(rng=st.randoms(use_true_random=False))
def test_light_in_any_writing(tmp_path_factory: pytest.TempPathFactory, rng: random.Random) -> None:
    nm = np.linspace(401.5, 699.25, 12)
    values = 3 + np.cos(nm / 30) ** 2
    name, of = rng.choice(LIGHTS)
    path = tmp_path_factory.mktemp("any") / "export.txt"
    path.write_bytes(spectrum_text(rng, nm, [(name, of(values))]))
    try:
        curve = read_spectrum(path)
    except UsageError:
        return
    assert_allclose(curve.wavelength_nm, nm, rtol=1e-7)
    assert_allclose(curve.value, values, rtol=1e-6)
