"""Reading of a material of any kind."""

from pathlib import Path

import pytest
from numpy.testing import assert_array_equal

from labrig.foundation.errors import UsageError
from labrig.material import (
    Material,
    ReradiationMatrix,
    read_any_material,
    write_fluorescent,
    write_reradiation,
)
from tests.material.reradiation.synthetic import YELLOW, measurement


def test_the_kind_decides(tmp_path: Path) -> None:
    paper = measurement(1, YELLOW).measured
    write_fluorescent(tmp_path / "paper.yaml", paper)
    write_reradiation(tmp_path / "bare.csv", paper)
    for name in ("paper.yaml", "bare.csv"):
        matrix = read_any_material(tmp_path / name)
        assert isinstance(matrix, ReradiationMatrix)
        assert_array_equal(matrix.reradiation, paper.reradiation)
    assert isinstance(read_any_material("blue-paint"), Material)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("name: a\nkind: metal\n", "'kind: phosphor' or 'kind: fluorescent', got 'metal'"),
        ("name: a\n", "got nothing"),
        ("name: a\nkind: fluorescent\n", "'matrix' is missing"),
        ("name: a\nkind: fluorescent\nmatrix: b.csv\n", "b.csv, got no such file"),
        ("name: a\nkind: fluorescent\nmatrix: .\n", "no such file"),
        ("name: a\nkind: phosphor\n", "'states'"),
        ("- a\n", "a list"),
        ("", "nothing"),
    ],
)
def test_broken_material_files_are_refused(tmp_path: Path, content: str, message: str) -> None:
    file = tmp_path / "material.yaml"
    file.write_text(content)
    with pytest.raises(UsageError, match=message):
        read_any_material(file)


def test_one_of_several_is_of_matrices_only() -> None:
    with pytest.raises(UsageError, match="file of matrices"):
        read_any_material("blue-paint", "yellow")
    with pytest.raises(UsageError, match="file of matrices"):
        read_any_material("blue-paint", pixel=(0, 0))
