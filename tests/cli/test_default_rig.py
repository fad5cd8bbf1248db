"""The default rig: chosen, told, overruled, dropped, and gone."""

from collections.abc import Callable
from pathlib import Path

import pytest
import typer

from labrig.record import read_run
from tests.conftest import Ended

Labrig = Callable[..., Ended]
Make = Callable[..., Path]


@pytest.fixture(autouse=True)
def settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Folder of this user's settings, empty."""
    folder = tmp_path / "settings" / "labrig"
    monkeypatch.setattr(typer, "get_app_dir", lambda name: str(folder))
    monkeypatch.delenv("LABRIG_RIG", raising=False)
    return folder


def refused(ended: Ended, *texts: str) -> None:
    assert (ended.code, len(ended.err.splitlines())) == (2, 1), ended.err
    for text in texts:
        assert text in ended.err


def test_a_chosen_rig_is_used_from_everywhere_and_told(
    labrig: Labrig, make_rig: Make, make_protocol: Make, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    rig = make_rig()
    monkeypatch.chdir(rig.parent)
    assert labrig("rig", "use", rig.name).code == 0
    monkeypatch.chdir(tmp_path.parent)
    assert str(rig) in labrig("rig", "use").out
    ended = labrig("run", make_protocol(), "--runs", tmp_path / "runs", "--no-process")
    assert ended.code == 0, ended.err
    assert ended.err.splitlines()[0] == f"rig: {rig}, by 'labrig rig use'"
    assert read_run(ended.run_folder).completed()
    planned = labrig("plan", make_protocol())
    assert str(rig) in planned.err
    assert "rig:" not in labrig("plan", make_protocol(), "--rig", "sim").err


def test_the_environment_has_priority_over_the_choice_and_the_option_over_both(
    labrig: Labrig, make_protocol: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    labrig("rig", "use", "sim-phosphor")
    assert labrig("plan", make_protocol()).err.splitlines()[0].startswith("rig: sim-phosphor,")
    monkeypatch.setenv("LABRIG_RIG", "sim")
    told = labrig("rig", "use").out
    assert told.startswith("sim, ")
    assert "LABRIG_RIG" in told
    assert labrig("plan", make_protocol()).err.splitlines()[0].startswith("rig: sim,")
    monkeypatch.setenv("LABRIG_RIG", "")
    assert labrig("rig", "use").out.startswith("sim-phosphor, ")


def test_a_forgotten_rig_is_not_used(labrig: Labrig, make_protocol: Make) -> None:
    for _ in range(2):
        assert labrig("rig", "use", "--forget").code == 0
        refused(labrig("plan", make_protocol()), "--rig", "labrig rig use")
        labrig("rig", "use", "sim")
    refused(labrig("rig", "use", "sim", "--forget"), "--forget")
    assert labrig("rig", "use").out.startswith("sim, ")


def test_a_default_that_is_gone_is_one_line(
    labrig: Labrig, make_rig: Make, make_protocol: Make, settings: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    rig = make_rig()
    labrig("rig", "use", rig)
    rig.unlink()
    for command in (["plan", make_protocol()], ["rig", "check"], ["rig", "use"]):
        refused(labrig(*command), str(rig), "labrig rig use FILE")
    assert labrig("rig", "use", "sim").code == 0
    (settings / "rig.txt").write_bytes(b"\xff\xfe")
    refused(labrig("plan", make_protocol()), "rig.txt", "labrig rig use FILE")
    monkeypatch.setenv("LABRIG_RIG", "simm")
    ended = labrig("plan", make_protocol())
    refused(ended, "did you mean 'sim'?", "LABRIG_RIG", "unset it")
    assert "rig use" not in ended.err, "which the variable would overrule"


def test_a_choice_that_the_environment_overrules_is_kept_and_told(
    labrig: Labrig, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LABRIG_RIG", "sim")
    told = labrig("rig", "use", "sim-phosphor").out
    assert "sim-phosphor" in told
    assert "LABRIG_RIG has priority" in told
    assert told.splitlines()[-1].startswith("sim, ")
    forgotten = labrig("rig", "use", "--forget").out
    assert "forgotten" in forgotten
    assert "LABRIG_RIG has priority" in forgotten
    monkeypatch.delenv("LABRIG_RIG")
    assert "no default rig" in labrig("rig", "use").out


def test_what_is_no_rig_is_not_chosen(labrig: Labrig, tmp_path: Path, settings: Path) -> None:
    (tmp_path / "mine.yaml").write_text("nmae: mine\n")
    refused(labrig("rig", "use", tmp_path / "mine.yaml"), "did you mean 'name'?")
    refused(labrig("rig", "use", tmp_path / "none.yaml"), "no such rig file")
    assert not settings.exists()
