"""Files of matrices as text: BFC, CSV, ART archives, EEM."""

import random
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from labrig.foundation.errors import UsageError
from labrig.material import ReradiationMatrix, read_reradiation, write_reradiation
from tests.material.reradiation.formats.matrices import (
    assert_same,
    random_matrices,
    two_dyes,
)
from tests.mutated_files import mutated


def eem() -> ReradiationMatrix:
    """A matrix in counts, measured from 20 nm beyond the excitation."""
    paper = two_dyes(1)
    far = paper.output_nm[:, np.newaxis] > paper.input_nm + 20
    counts = np.where(far, np.round(paper.reradiation * 1e6) + 0.5, np.nan)
    nothing = np.full(41, np.nan)
    return replace(paper, name="m", reflectance=nothing, reradiation=counts, unit="relative")


def with_sigma(matrix: ReradiationMatrix, seed: int) -> ReradiationMatrix:
    rng = np.random.default_rng(seed)
    return replace(
        matrix,
        reflectance_sigma=rng.uniform(0, 1, matrix.reflectance.shape),
        reradiation_sigma=rng.uniform(0, 1, matrix.reradiation.shape),
        column_correlation=rng.uniform(0, 1, matrix.input_nm.shape),
    )


def there_and_back(matrix: ReradiationMatrix, path: Path) -> ReradiationMatrix:
    write_reradiation(path, matrix)
    return read_reradiation(path)


def edited(path: Path, edit: Callable[[list[str]], list[str]]) -> Path:
    """The file of two dyes with some of its lines changed."""
    write_reradiation(path, eem() if path.suffix == ".txt" else with_sigma(two_dyes(2), 2))
    lines = edit(path.read_text(encoding="utf-8").split("\n"))
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


@pytest.mark.parametrize("ending", [".BFC", ".ark"])
def test_fractions_come_back(tmp_path: Path, ending: str) -> None:
    paper = two_dyes(3)
    read = there_and_back(paper, tmp_path / f"m{ending}")
    assert_same(read, paper, rtol=1e-15)


def test_a_table_keeps_all(tmp_path: Path) -> None:
    paper = two_dyes(4)
    assert_same(there_and_back(paper, tmp_path / "m.csv"), paper)
    assert_same(there_and_back(with_sigma(paper, 4), tmp_path / "m.csv"), with_sigma(paper, 4))
    whole = with_sigma(paper, 5)
    for partly in (replace(whole, reflectance_sigma=None), replace(whole, reradiation_sigma=None)):
        assert_same(there_and_back(partly, tmp_path / "m.csv"), partly)


def test_a_table_that_a_spreadsheet_saved_is_the_same(tmp_path: Path) -> None:
    path = tmp_path / "m.csv"
    write_reradiation(path, with_sigma(two_dyes(12), 12))
    filled = (
        line + "," * 50 if line.startswith(("# unit", "# sigma")) else line
        for line in path.read_text(encoding="utf-8").splitlines()
    )
    path.write_text("\r\n".join(filled), encoding="utf-8-sig")
    assert_same(read_reradiation(path), with_sigma(two_dyes(12), 12))


def test_an_eem_comes_back(tmp_path: Path) -> None:
    assert_same(there_and_back(eem(), tmp_path / "m.txt"), eem())
    assert_same(there_and_back(eem(), tmp_path / "m.csv"), eem())


@given(matrix=random_matrices(), seed=st.integers(0, 99))
def test_any_matrix_comes_back_from_a_table(
    tmp_path_factory: pytest.TempPathFactory, matrix: ReradiationMatrix, seed: int
) -> None:
    path = tmp_path_factory.mktemp("any") / "m.csv"
    assert_same(there_and_back(matrix, path), matrix)
    assert_same(there_and_back(with_sigma(matrix, seed), path), with_sigma(matrix, seed))


@given(matrix=random_matrices(even=True), ending=st.sampled_from([".bfc", ".ark"]))
def test_fractions_at_even_steps_come_back(
    tmp_path_factory: pytest.TempPathFactory, matrix: ReradiationMatrix, ending: str
) -> None:
    path = tmp_path_factory.mktemp("any") / f"m{ending}"
    # An output without an input of its wavelength has no reflectance to be written.
    assert_same(there_and_back(matrix, path), matrix, rtol=1e-15)


@given(matrix=random_matrices())
def test_any_eem_comes_back(
    tmp_path_factory: pytest.TempPathFactory, matrix: ReradiationMatrix
) -> None:
    nothing = np.full(len(matrix.output_nm), np.nan)
    relative = replace(matrix, name="m", reflectance=nothing, unit="relative")
    path = tmp_path_factory.mktemp("any") / "m.txt"
    assert_same(there_and_back(relative, path), relative)


@given(
    ending=st.sampled_from([".bfc", ".csv", ".ark", ".txt"]),
    at=st.floats(0, 1),
    change=st.one_of(
        st.just(None), st.binary(min_size=1, max_size=6), st.sampled_from([b"\r\n", b"nan", b"1e9"])
    ),
)
def test_a_broken_text_is_read_or_refused_in_one_line(
    tmp_path_factory: pytest.TempPathFactory, ending: str, at: float, change: bytes | None
) -> None:
    path = tmp_path_factory.mktemp("any") / f"m{ending}"
    small = replace(eem(), name="m") if ending == ".txt" else two_dyes(6)
    narrow = small.rebinned(np.arange(400.0, 460, 10), np.arange(400.0, 460, 10))
    if ending == ".txt":
        narrow = replace(narrow, reradiation=np.where(narrow.reradiation > 0, 1.5, np.nan))
    write_reradiation(path, narrow)
    content = path.read_bytes()
    place = int(at * len(content))
    after = b"" if change is None else change + content[place + len(change) :]
    path.write_bytes(content[:place] + after)
    try:
        read_reradiation(path)
    except UsageError as error:
        assert "\n" not in str(error)


@pytest.mark.parametrize("ending", [".bfc", ".csv", ".ark", ".txt", ".exr"])
def test_a_file_that_came_to_harm_is_read_or_refused_in_one_line(
    tmp_path: Path, ending: str
) -> None:
    path = tmp_path / f"m{ending}"
    write_reradiation(path, eem() if ending == ".txt" else two_dyes(11))
    sound = path.read_bytes()
    for number in range(40):
        path.write_bytes(mutated(sound, random.Random(f"{ending} {number}")))
        try:
            read_reradiation(path)
        except UsageError as error:
            assert len(str(error).splitlines()) == 1, number


@given(content=st.binary(max_size=80), ending=st.sampled_from([".bfc", ".csv", ".ark", ".txt"]))
def test_any_bytes_are_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, content: bytes, ending: str
) -> None:
    path = tmp_path_factory.mktemp("any") / f"m{ending}"
    path.write_bytes(content)
    try:
        read_reradiation(path)
    except UsageError as error:
        assert "\n" not in str(error)


def without(*numbers: int) -> Callable[[list[str]], list[str]]:
    """Edit: lines of these numbers, from 1, left out."""
    return lambda lines: [line for k, line in enumerate(lines, start=1) if k not in numbers]


def cut_to(number: int) -> Callable[[list[str]], list[str]]:
    return lambda lines: lines[:number]


def swapped(number: int, old: str, new: str) -> Callable[[list[str]], list[str]]:
    def edit(lines: list[str]) -> list[str]:
        assert old in lines[number - 1]
        lines[number - 1] = lines[number - 1].replace(old, new, 1)
        return lines

    return edit


@pytest.mark.parametrize(
    ("ending", "edit", "message"),
    [
        (".bfc", without(2), "second line"),
        (".bfc", cut_to(11), "line 11: the file ends before its first row"),
        (".bfc", cut_to(12), "line 12: expected 41 rows of numbers, got none"),
        (".bfc", cut_to(32), "line 32: expected 41 rows of numbers, got 20"),
        (".bfc", cut_to(53), "line 53: expected EOD"),
        (".bfc", without(20), "line 20: expected the row of 450 nm, got 460"),
        (".bfc", swapped(11, "780", "785"), "line 11: expected six integers"),
        (".bfc", swapped(11, "380", "38O"), "line 11: expected six integers"),
        (".bfc", swapped(12, "\t310", ""), "line 12: expected the 49 input wavelengths"),
        (".bfc", swapped(14, "\t", "\t0.1\t"), "line 14: expected 49 values, got 50"),
        (".bfc", swapped(14, "\t", "\t1e6"), "line 14: expected fractions|line 14"),
        (".bfc", swapped(14, "\t", "\tnan"), "line 14: expected a"),
        (".bfc", swapped(14, "\t", "\t--"), "line 14: expected a number"),
        (".csv", swapped(3, "output_nm", "nm"), "line 3: expected a header"),
        (".csv", swapped(3, ",", ";"), "line 3: expected a header"),
        (".csv", swapped(3, "310.0", "290.0"), "line 3: expected wavelengths that rise"),
        (".csv", swapped(2, "1/nm", "1/m"), "'# unit:' per band, 1/nm, relative; got '1/m'"),
        (".csv", swapped(2, "unit", "units"), "line 2: did you mean '# unit:'"),
        (".csv", swapped(7, ",", ",,"), "line 7: expected 51 cells as in the header, got 52"),
        (".csv", swapped(7, ",", ",x"), "line 7: expected a number"),
        (".csv", swapped(7, ",", ",inf,"), "line 7: expected"),
        (".csv", without(7, 8), "same wavelengths in the table of sigma"),
        (".csv", cut_to(3), "expected a header and rows"),
        (".ark", without(1), "first line"),
        (".ark", swapped(1, "1.1", "1.1\nEntry ID: yellow_paper"), "ID of its own"),
        (".ark", swapped(7, "Entry ID", "Entry"), "entries that begin with 'Entry ID:', got none"),
        (".ark", swapped(18, "regular", "irregular"), "line 18: expected regular sampling"),
        (".ark", without(19), "expected 'Reflectance start: … nm'"),
        (".ark", swapped(19, "nm", "um"), "line 19: expected 'Reflectance start' in nm"),
        (".ark", swapped(27, "}}", ""), "line 27: expected rows"),
        (".ark", swapped(27, "}, {", ", "), "line 27: row 2 has 49 samples, the first has 98"),
        (".ark", swapped(27, "{{", "{{5e9, "), "line 27: row 2 has 49 samples"),
        (".ark", swapped(27, ", ", "e9, "), "line 27: expected fractions|a number"),
        (".txt", cut_to(2), "got 2 lines"),
        (".txt", swapped(1, "390", "370"), "line 1: expected wavelengths that rise"),
        (".txt", swapped(3, " 0", ""), "line 3: expected an excitation wavelength and 41"),
        (".txt", swapped(3, "770", "nan"), "line 3: expected a finite number"),
        (".txt", swapped(3, "770", "790"), "lines 2 to 50: expected wavelengths that rise"),
    ],
)
def test_what_is_broken_is_refused_by_line(
    tmp_path: Path, ending: str, edit: Callable[[list[str]], list[str]], message: str
) -> None:
    with pytest.raises(UsageError, match=message) as caught:
        read_reradiation(edited(tmp_path / f"m{ending}", edit))
    assert "\n" not in str(caught.value)


def test_a_table_per_nm_and_one_per_band_are_one_matrix(tmp_path: Path) -> None:
    rows = ["380,0.5,0.01", "390,0.2,0.6", "400,0.3,0.4"]
    per_band, per_nm = tmp_path / "band.csv", tmp_path / "nm.csv"
    per_band.write_text("\n".join([r"out_nm\in_nm,380,390", *rows]))
    rows = ["380,0.5,0.001", "390,0.02,0.6", "400,0.03,0.04"]
    per_nm.write_text("\n".join(["# unit: 1/nm", "output_nm,380,390", *rows]))
    of_bands, other = read_reradiation(per_band), read_reradiation(per_nm)
    assert_same(replace(other, name="band"), of_bands, rtol=1e-15)
    assert_array_equal(of_bands.reflectance, [0.5, 0.6, np.nan])
    assert_allclose(of_bands.reradiation, [[0, 0.001], [0.02, 0], [0.03, 0.04]])
    sigmas = ["# sigma", "output_nm,380,390", "380,0.1,0.2", "390,0.3,0.4", "400,0.5,0.6"]
    per_nm.write_text(per_nm.read_text() + "\n" + "\n".join(sigmas))
    with_sigmas = read_reradiation(per_nm)
    assert with_sigmas.reflectance_sigma is not None
    assert with_sigmas.reradiation_sigma is not None
    assert_array_equal(with_sigmas.reflectance_sigma, [0.1, 0.4, np.nan])
    assert_allclose(with_sigmas.reradiation_sigma, [[0, 0.2], [0.3, 0], [0.5, 0.6]])
    apart = tmp_path / "apart.csv"
    rows = ["380,0.5,0,0.01", "390,0.6,0.2,0", "400,,0.3,0.4"]
    apart.write_text("\n".join(["# unit: per band", "output_nm,reflectance,380,390", *rows]))
    assert_same(replace(read_reradiation(apart), name="band"), of_bands, rtol=1e-15)


def test_matrices_of_an_archive_are_chosen_by_name(tmp_path: Path) -> None:
    path = tmp_path / "two.ark"
    write_reradiation(path, two_dyes(7))
    whole = path.read_text(encoding="utf-8")
    entry = whole[whole.index("Entry ID") :]
    plain = entry.replace("yellow_paper", "plain").replace("{{", "{").split("},")[0] + "}\n"
    path.write_text(whole + entry.replace("yellow_paper", "white") + plain, encoding="utf-8")
    with pytest.raises(UsageError, match=r"got 2 \(yellow_paper, white\); name one"):
        read_reradiation(path)
    assert_same(read_reradiation(path, "white"), two_dyes(7), rtol=1e-15)
    with pytest.raises(UsageError, match="no matrix is called 'plain'"):
        read_reradiation(path, "plain")
    path.write_text(whole[: whole.index("Entry ID")] + plain, encoding="utf-8")
    with pytest.raises(UsageError, match="got 1 plain spectra"):
        read_reradiation(path)


def test_a_name_is_that_of_the_file_or_in_it(tmp_path: Path) -> None:
    for ending in (".bfc", ".csv", ".ark"):
        path = tmp_path / f"paper{ending}"
        write_reradiation(path, replace(two_dyes(8), name=""))
        assert read_reradiation(path).name == ("matrix" if ending == ".ark" else "paper")
        write_reradiation(path, replace(two_dyes(8), name=" é  paper"))
        assert read_reradiation(path).name == "é paper"
    with pytest.raises(UsageError, match="no matrix is called 'x'"):
        read_reradiation(tmp_path / "paper.csv", "x")


@pytest.mark.parametrize(
    ("ending", "change", "message"),
    [
        (".bfc", {"unit": "relative"}, "the re-radiation is relative"),
        (".bfc", {"name": "λ"}, "names in ISO-8859-1, not 'λ'"),
        (".bfc", {"input_nm": np.arange(300.0, 781, 10) ** 1.001}, "even steps|input band"),
        (".bfc", {"reflectance": np.full(41, np.nan)}, "some reflectance was not measured"),
        (".ark", {"reradiation": np.full((41, 49), np.nan)}, "some entry was not measured"),
        (".ark", {"reradiation": np.full((41, 49), 1.0)}, "above 2 in magnitude"),
        (".txt", {}, "relative intensities without reflectance"),
        (".csv", {"output_nm": np.arange(38.0, 79, 1)}, "expected wavelengths from 100"),
        (".json", {}, "expected the ending BFC"),
    ],
)
def test_what_a_format_cannot_hold_is_refused(
    tmp_path: Path, ending: str, change: dict[str, object], message: str
) -> None:
    path = tmp_path / f"m{ending}"
    with pytest.raises(UsageError, match=message):
        write_reradiation(path, replace(two_dyes(9), **change))  # type: ignore[arg-type]
    assert not path.exists()


def test_other_files_are_refused(tmp_path: Path) -> None:
    for name, message in (("a.csv", "no such file"), ("a.json", "no such file")):
        with pytest.raises(UsageError, match=message):
            read_reradiation(tmp_path / name)
    (tmp_path / "a.json").write_text("{}")
    with pytest.raises(UsageError, match="expected the ending"):
        read_reradiation(tmp_path / "a.json")
    write_reradiation(tmp_path / "a.csv", two_dyes(10))
    with pytest.raises(UsageError, match="for a pixel"):
        read_reradiation(tmp_path / "a.csv", pixel=(0, 0))


def test_real_bfc_files(shared_data: Path) -> None:
    folder = shared_data / "bispectral/rit_bfc450"
    paths = sorted(folder.glob("*.BFC"))
    matrices = [read_reradiation(path) for path in paths]
    assert len(matrices) == 97
    assert sum(float(matrix.reradiated_fraction.max()) > 0.1 for matrix in matrices) >= 44
    golf = matrices[[path.stem for path in paths].index("GOLF")]
    assert (golf.name, golf.reradiation.shape) == ("golfball", (41, 49))
    assert golf.reflectance[0] == 0.205374
    assert golf.reradiation[0, 0] == -0.0000215692
    for path in sorted((folder / "bcra_repeats/bcraday01").glob("*.BFC")):
        assert np.isfinite(read_reradiation(path).reflectance).all()


def test_a_real_archive_is_its_tables(shared_data: Path) -> None:
    folder = shared_data / "bispectral/art_postit"
    for colour in ("green", "yellow"):
        name = f"fluorescent_{colour}"
        archived = read_reradiation(folder / "FluorescentPostIt_yellow_green.ark", name)
        assert archived.name == f"3M fluorescent {colour} Post-It (R) sticker"
        assert_same(replace(archived, name=name), read_reradiation(folder / f"{name}.csv"))


def test_real_eem_files(shared_data: Path) -> None:
    paths = sorted((shared_data / "bispectral/webfluor_eem").glob("*.txt"))
    matrices = {path.stem: read_reradiation(path) for path in paths}
    assert {matrix.reradiation.shape for matrix in matrices.values()} == {(99, 28)}
    assert {matrix.unit for matrix in matrices.values()} == {"relative"}
    fad = matrices["FAD"]
    assert fad.input_nm[[0, -1]].tolist() == [250, 520]
    # The first intensity of its second line that is not 0.
    assert fad.reradiation[fad.output_nm == 530.0, -1] == 25250
    assert np.isnan(fad.reradiation[fad.output_nm < 530.0, -1]).all()
