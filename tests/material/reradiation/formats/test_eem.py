"""Excitation-emission matrices as instruments write them: which axis is which, and scatter."""

import random
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st
from numpy.testing import assert_allclose

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.material import MatrixLayout, ReradiationMatrix, read_reradiation
from tests.written_spectra import matrix_text

EXCITATION_NM = np.arange(300.0, 465, 10)
EMISSION_NM = np.arange(330.0, 701, 10)


def dye(
    excitation_nm: FloatArray = EXCITATION_NM, emission_nm: FloatArray = EMISSION_NM
) -> FloatArray:
    """Intensities of a dye excited at 365 nm that emits at 520 nm, and noise."""
    noise = np.random.default_rng(5).normal(0, 1, (len(emission_nm), len(excitation_nm)))
    peak = np.exp(-(((emission_nm[:, np.newaxis] - 520) / 40) ** 2))
    return 1000 * peak * np.exp(-(((excitation_nm - 365) / 40) ** 2)) + noise


def with_lines(
    counts: FloatArray, excitation_nm: FloatArray, emission_nm: FloatArray
) -> FloatArray:
    """Add light scattered in the first and the second order of the grating."""
    away_nm = emission_nm[:, np.newaxis] - excitation_nm
    twice_nm = emission_nm[:, np.newaxis] - 2 * excitation_nm
    return counts + 1e5 * np.exp(-((away_nm / 4) ** 2)) + 2e4 * np.exp(-((twice_nm / 5) ** 2))


def peak(matrix: ReradiationMatrix) -> tuple[float, float]:
    row, column = np.unravel_index(np.nanargmax(matrix.reradiation), matrix.reradiation.shape)
    return float(matrix.input_nm[column]), float(matrix.output_nm[row])


def grid(corner: str, above_nm: FloatArray, left_nm: FloatArray, table: FloatArray) -> str:
    rows = [[f"{nm:g}", *(f"{v:.6g}" for v in row)] for nm, row in zip(left_nm, table, strict=True)]
    return "\n".join(
        "\t".join(cells) for cells in ([corner, *(f"{nm:g}" for nm in above_nm)], *rows)
    )


@pytest.mark.parametrize("corner", ["sample", "", "Wavelength", "Em", "Emission (nm)", "Em/Ex"])
def test_either_orientation(tmp_path: Path, corner: str) -> None:
    other = corner.replace("Emission", "Excitation") if "/" not in corner else "Ex/Em"
    (tmp_path / "a.txt").write_text(grid(corner, EXCITATION_NM, EMISSION_NM, dye()))
    (tmp_path / "b.dat").write_text(
        grid(
            other.replace("Em", "Ex") if other == "Em" else other,
            EMISSION_NM,
            EXCITATION_NM,
            dye().T,
        )
    )
    for name in ("a.txt", "b.dat"):
        matrix = read_reradiation(tmp_path / name)
        assert matrix.unit == "relative"
        assert_allclose(matrix.reradiation, dye(), rtol=1e-5)
        assert_allclose(matrix.input_nm, EXCITATION_NM)


def test_wavelengths_alone_above_the_columns(tmp_path: Path) -> None:
    text = grid("x", EMISSION_NM, EXCITATION_NM, dye().T).removeprefix("x\t")
    (tmp_path / "m.txt").write_text(text)
    assert peak(read_reradiation(tmp_path / "m.txt")) == (370, 520)


def test_axes_that_nothing_tells_are_asked_for(tmp_path: Path) -> None:
    nm = np.arange(400.0, 500, 10)
    (tmp_path / "m.txt").write_text(grid("", nm, nm, np.ones((10, 10))))
    with pytest.raises(UsageError, match="say --rows emission or --rows excitation"):
        read_reradiation(tmp_path / "m.txt")
    matrix = read_reradiation(tmp_path / "m.txt", layout=MatrixLayout(rows="emission"))
    assert matrix.reradiation.shape == (10, 10)


def test_names_that_the_signal_contradicts_are_refused(tmp_path: Path) -> None:
    (tmp_path / "m.txt").write_text(grid("Excitation", EXCITATION_NM, EMISSION_NM, dye()))
    with pytest.raises(UsageError, match="named excitation and the signal on the other side"):
        read_reradiation(tmp_path / "m.txt")


def test_scattered_light_is_not_measured(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    excitation_nm, emission_nm = np.arange(250.0, 451, 5), np.arange(260.0, 701, 4)
    counts = dye(excitation_nm, emission_nm)
    text = grid("x", excitation_nm, emission_nm, with_lines(counts, excitation_nm, emission_nm))
    (tmp_path / "m.txt").write_text(text)
    matrix = read_reradiation(tmp_path / "m.txt")
    assert peak(matrix) == (365, 520)
    away_nm = np.abs(emission_nm[:, np.newaxis] - excitation_nm)
    twice_nm = np.abs(emission_nm[:, np.newaxis] - 2 * excitation_nm)
    assert np.isnan(matrix.reradiation[(away_nm < 10) | (twice_nm < 10)]).all()
    clear = (away_nm > 25) & (twice_nm > 25) & (np.abs(away_nm - 45) > 40)
    assert_allclose(matrix.reradiation[clear], counts[clear], rtol=1e-4, atol=1e-3)
    assert "scattered light left out" in caplog.text


def test_a_matrix_without_scatter_keeps_all(tmp_path: Path) -> None:
    (tmp_path / "m.txt").write_text(grid("x", EXCITATION_NM, EMISSION_NM, dye()))
    assert np.isfinite(read_reradiation(tmp_path / "m.txt").reradiation).all()


def test_a_saturated_detector_measured_nothing(tmp_path: Path) -> None:
    counts = np.minimum(dye(), 900)
    (tmp_path / "m.txt").write_text(grid("x", EXCITATION_NM, EMISSION_NM, counts))
    matrix = read_reradiation(tmp_path / "m.txt")
    assert (np.isnan(matrix.reradiation) == (counts == 900)).all()


def test_zero_below_the_excitation_was_not_measured(tmp_path: Path) -> None:
    counts = np.where(EMISSION_NM[:, np.newaxis] > EXCITATION_NM + 20, dye() + 10, 0)
    (tmp_path / "m.txt").write_text(grid("x", EXCITATION_NM, EMISSION_NM, counts))
    matrix = read_reradiation(tmp_path / "m.txt")
    assert (np.isnan(matrix.reradiation) == (counts == 0)).all()


def test_scans_in_pairs_of_columns(tmp_path: Path) -> None:
    head = ["".join(f"s_EX_{nm:.2f},," for nm in EXCITATION_NM)]
    head.append("Wavelength (nm),Intensity (a.u.)," * len(EXCITATION_NM))
    rows = [
        "".join(f"{nm:g},{value:.6g}," for value in row)
        for nm, row in zip(EMISSION_NM, dye(), strict=True)
    ]
    (tmp_path / "m.csv").write_text("\r\n".join([*head, *rows, "", "01_EX_300.00,", "Slit (nm) 5"]))
    assert_allclose(read_reradiation(tmp_path / "m.csv").reradiation, dye(), rtol=1e-5)


def test_synchronous_scans(tmp_path: Path) -> None:
    ahead_nm = np.arange(20.0, 301, 10)
    away = [dye(np.array([nm]), nm + ahead_nm)[:, 0] for nm in EXCITATION_NM]
    lines = [",".join(["", *(f"01_SYN_{nm:.2f}" for nm in ahead_nm)])]
    lines += [
        ",".join([f"{nm:g}", *(f"{value:.6g}" for value in row)])
        for nm, row in zip(EXCITATION_NM, away, strict=True)
    ]
    (tmp_path / "m.csv").write_text("\n".join([*lines, "", "01_SYN_20.00", "Slit (nm)  5"]))
    assert peak(read_reradiation(tmp_path / "m.csv")) == (370, 520)


def test_spectra_without_their_excitation(tmp_path: Path) -> None:
    lines = [
        f"{nm:.6f}\t{value:.6f}"
        for row in dye().T
        for nm, value in zip(EMISSION_NM, row, strict=True)
    ]
    (tmp_path / "m.TXT").write_text("\r\n".join(lines))
    with pytest.raises(UsageError, match="got 17 spectra from 330 to 700 nm: give them"):
        read_reradiation(tmp_path / "m.TXT")
    layout = MatrixLayout(excitation_nm=EXCITATION_NM)
    assert_allclose(
        read_reradiation(tmp_path / "m.TXT", layout=layout).reradiation, dye(), atol=1e-6
    )
    with pytest.raises(UsageError, match="expected 2 spectra"):
        read_reradiation(tmp_path / "m.TXT", layout=MatrixLayout(excitation_nm=EXCITATION_NM[:2]))


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("m.csv", "wavelength_nm,400,500\n410,1,2\n420,1,2\n430,1,2\n", "got a table of curves"),
        ("m.txt", "400 1\n500 2\n600 3\n", "got two columns"),
        ("m.txt", "x 300 310\n500 1 2\n510 1 x\n520 1 3\n", "line 3: expected a number"),
        ("m.csv", "nm,A,B\n500,1,2\n510,1,2\n", "such as EX_220"),
    ],
)
def test_other_tables_are_refused(tmp_path: Path, name: str, text: str, said: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(UsageError, match=said):
        read_reradiation(tmp_path / name)


def test_the_command_asks_and_is_told(labrig: Callable[..., object], tmp_path: Path) -> None:
    nm = np.arange(400.0, 500, 10)
    (tmp_path / "m.txt").write_text(grid("", nm, nm, np.ones((10, 10))))
    arguments = ("material", "convert", tmp_path / "m.txt", tmp_path / "m.csv")
    assert labrig(*arguments).code == 2  # type: ignore[attr-defined]
    assert labrig(*arguments, "--rows", "emission").code == 0  # type: ignore[attr-defined]
    for wrong in (("--rows", "across"), ("--excitation", "230:450"), ("--excitation", "1:nan:0")):
        ended = labrig(*arguments, *wrong)
        assert ended.code == 2  # type: ignore[attr-defined]
        assert wrong[0] in ended.err  # type: ignore[attr-defined]


@given(rng=st.randoms(use_true_random=False))
def test_a_matrix_in_any_writing(
    tmp_path_factory: pytest.TempPathFactory, rng: random.Random
) -> None:
    excitation_nm, emission_nm = np.arange(320.0, 421, 20), np.arange(440.0, 601, 20)
    path = tmp_path_factory.mktemp("any") / rng.choice(["m.txt", "m.csv", "m.dat"])
    counts = dye(excitation_nm, emission_nm)
    path.write_bytes(matrix_text(rng, excitation_nm, emission_nm, counts))
    try:
        matrix = read_reradiation(path)
    except UsageError:
        return
    assert_allclose(matrix.input_nm, excitation_nm)
    assert_allclose(matrix.output_nm, emission_nm)
    assert_allclose(matrix.reradiation, counts, rtol=1e-8)


#: Number of emission and excitation bands of real exports, and the excitation and emission of their
#: maximum beside scattered light.
REAL_EXPORTS = {
    "fluoromax4_f1.dat": ((116, 43), (240, 360)),
    "aqualog_sample4.dat": ((250, 113), (275, 308.798)),
    "cary_scans_day_1_sample1.csv": ((186, 47), (225, 418.0299988)),
    "custom_cary.csv": ((97, 101), (250, 450)),
    "hitachi-f7000-fl_hitachi1.TXT": ((176, 51), (200, 558)),
    "shimadzu_shimadzu.TXT": ((181, 45), (240, 482)),
}


def test_real_exports(shared_data: Path) -> None:
    stated = {"shimadzu_shimadzu.TXT": MatrixLayout(excitation_nm=np.arange(230.0, 451, 5))}
    found = {}
    for name in REAL_EXPORTS:
        path = shared_data / "instrument_exports" / "eemr" / name
        matrix = read_reradiation(path, layout=stated.get(name, MatrixLayout()))
        found[name] = matrix.reradiation.shape, peak(matrix)
    assert found == REAL_EXPORTS
