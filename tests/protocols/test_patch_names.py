"""Names of patches become folders: what no disk or no person could tell apart is refused."""

from collections.abc import Callable
from pathlib import Path

import pytest

from labrig.foundation.yaml_file import read_yaml
from tests.conftest import Ended

WHOLE = "[0, 0, 1, 1]"


def planned(labrig: Callable[..., Ended], path: Path, patches: str) -> Ended:
    path.write_text(f"protocol: decay\npatches: {patches}\n", encoding="utf-8")
    return labrig("plan", path, "--rig", "sim")


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("a/b", "'a/b'"),
        (r"a\b", r"'a\b'"),
        ("../up", "'../up'"),
        ("..", "'..'"),
        (".hidden", "'.hidden'"),
        ("report.html", "'report.html'"),
        ("'C:'", "'C:'"),
        ("''", "''"),
        ("~", "''"),
        ("' '", "' '"),
        ("'end '", "'end '"),
        ("1.5", "'1.5'"),
        ("figures", "'figures'"),
        ("Con", "'Con'"),
        (r'"tab\there"', "can be folders"),
        ("x" * 61, "1 to 60"),
    ],
)
def test_what_is_no_folder_is_refused_before_anything_moves(
    labrig: Callable[..., Ended], tmp_path: Path, name: str, said: str
) -> None:
    ended = planned(labrig, tmp_path / "p.yaml", f"{{{name}: {WHOLE}}}")
    assert ended.code == 2
    assert len(ended.err.splitlines()) == 1
    assert "p.yaml: patches: expected" in ended.err
    assert said in ended.err


@pytest.mark.parametrize(
    ("patches", "said"),
    [
        (f"{{Paint: {WHOLE}, paint: {WHOLE}}}", "'Paint' and 'paint'"),
        # one letter with its dots, and u followed by the dots alone
        (f"{{für: {WHOLE}, fu\u0308r: {WHOLE}}}", "differ"),
        (f"{{paint: {WHOLE}, paint: {WHOLE}}}", "'paint' stands twice"),
        ("{}", "name: [x, y, width, height]"),
        (WHOLE, "name: [x, y, width, height]"),
    ],
)
def test_two_of_one_name_and_none_at_all_are_refused(
    labrig: Callable[..., Ended], tmp_path: Path, patches: str, said: str
) -> None:
    ended = planned(labrig, tmp_path / "p.yaml", patches)
    assert (ended.code, len(ended.err.splitlines())) == (2, 1)
    assert said in ended.err


def test_names_of_any_script_and_numbers_are_folders_of_the_result(
    labrig: Callable[..., Ended],
    make_rig: Callable[..., Path],
    make_protocol: Callable[..., Path],
    tmp_path: Path,
) -> None:
    left, right = [0.3, 0.3, 0.2, 0.4], [0.5, 0.3, 0.2, 0.4]
    protocol = make_protocol(patches={1: left, "Früh Grün, 2 %": right})
    ended = labrig("run", protocol, "--rig", make_rig(), "--runs", tmp_path / "runs")
    assert ended.code == 0, ended.err
    result = ended.run_folder / "result"
    assert (result / "1" / "fit.json").is_file()
    assert (result / "Früh Grün, 2 %" / "fit.json").is_file()
    assert list(read_yaml(result / "provenance.yaml")["regions"]) == ["1", "Früh Grün, 2 %"]
