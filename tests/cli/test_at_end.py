"""Somebody outside the dark room is told when a run has ended."""

import json
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.conftest import Ended
from tests.quick_yaml import read_quickly, write_quickly

Labrig = Callable[..., Ended]
Make = Callable[..., Path]

NOTES = (
    "import json, os, sys; "
    "json.dump({k: v for k, v in os.environ.items() if k.startswith('LABRIG_')},"
    " open(sys.argv[1], 'w'))"
)


def telling(make_rig: Make, command: object, **simulation: object) -> Path:
    path = make_rig(**simulation)
    path.write_text(write_quickly(read_quickly(path.read_text()) | {"on_finish": command}))
    return path


@pytest.mark.parametrize(
    ("faults", "code", "status"), [([], 0, "done"), ([{"camera_unplugged": {}}], 3, "failed")]
)
def test_a_command_is_reported_how_it_ended(
    labrig: Labrig,
    make_rig: Make,
    make_protocol: Make,
    tmp_path: Path,
    faults: list[object],
    code: int,
    status: str,
) -> None:
    told = tmp_path / "told.json"
    rig = telling(make_rig, [sys.executable, "-c", NOTES, str(told)], faults=faults)
    ended = labrig("run", make_protocol(), "--rig", rig, "--runs", tmp_path / "runs", "--on-finish")
    assert ended.code == code
    said = json.loads(told.read_text())
    assert said["LABRIG_STATUS"] == status
    assert said["LABRIG_MESSAGE"] in (ended.out if code == 0 else ended.err)
    assert said["LABRIG_MESSAGE"]


def test_a_bell_rings_and_resumed_runs_ring_it_too(
    labrig: Labrig, make_rig: Make, make_protocol: Make, tmp_path: Path
) -> None:
    rig = telling(make_rig, "bell")
    ended = labrig("run", make_protocol(), "--rig", rig, "--runs", tmp_path, "--no-process")
    assert ended.err.count("\a") == 1
    assert labrig("resume", ended.run_folder, "--no-process").err.count("\a") == 1


def test_a_command_is_started_by_the_consent_of_rig_use_until_it_changes(
    labrig: Labrig,
    make_rig: Make,
    make_protocol: Make,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "settings"))
    monkeypatch.setenv("APPDATA", str(tmp_path / "settings"))
    monkeypatch.setenv("HOME", str(tmp_path / "settings"))
    told, protocol = tmp_path / "told.json", make_protocol()
    rig = telling(make_rig, [sys.executable, "-c", NOTES, str(told)])
    arguments = ("run", protocol, "--rig", rig, "--runs", tmp_path / "runs", "--no-process")

    assert "at end" in labrig("plan", protocol, "--rig", rig).out
    assert labrig(*arguments).code == 0
    assert not told.exists()

    assert str(told) in labrig("rig", "use", rig).err
    assert labrig(*arguments).code == 0
    assert told.exists()

    told.unlink()
    telling(make_rig, [sys.executable, "-c", f"{NOTES};", str(told)])
    assert "--on-finish" in labrig(*arguments).err
    assert not told.exists()


def test_a_command_in_a_folder_from_elsewhere_is_run_only_if_asked_for(
    labrig: Labrig, make_rig: Make, make_protocol: Make, tmp_path: Path
) -> None:
    told = tmp_path / "told.json"
    run = labrig("run", make_protocol(), "--rig", make_rig(), "--runs", tmp_path, "--no-process")
    path = run.run_folder / "rig.yaml"
    command = [sys.executable, "-c", NOTES, str(told)]
    path.write_text(write_quickly(read_quickly(path.read_text()) | {"on_finish": command}))
    resume = ("resume", run.run_folder, "--no-process")
    assert labrig(*resume, "--on-finish").code == 0
    assert not told.exists(), "the journal has no command"
    ended = labrig(*resume, "--edited")
    assert (ended.code, told.exists()) == (0, False)
    (note,) = [line for line in ended.err.splitlines() if "--on-finish" in line]
    assert str(told) in note
    assert labrig(*resume, "--edited", "--on-finish").code == 0
    assert json.loads(told.read_text())["LABRIG_STATUS"] == "done"


def test_a_command_that_fails_costs_a_warning_only(
    labrig: Labrig, make_rig: Make, make_protocol: Make, tmp_path: Path
) -> None:
    rig = telling(make_rig, ["no-such-command-anywhere"])
    options = ("--runs", tmp_path, "--no-process", "--on-finish")
    ended = labrig("run", make_protocol(), "--rig", rig, *options)
    assert ended.code == 0
    assert "labrig: warning: on_finish" in ended.err


def test_a_new_protocol_file_is_commented_and_every_comment_in_it_is_true(
    labrig: Labrig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert labrig("protocol", "new", "decay").code == 0
    again = labrig("protocol", "new", "decay")
    assert (again.code, len(again.err.splitlines())) == (2, 1)
    written = (tmp_path / "my-decay.yaml").read_text()
    lines = written.splitlines()
    choices = [n for n, line in enumerate(lines) if is_choice(line)]
    assert len(choices) > 5
    for number in choices:
        line = lines[number].replace("# ", "", 1)
        key = line.split(":")[0]
        others = [other for other in lines if not other.startswith(f"{key}:")]
        extra = ["background: [0.0, 0.0, 0.06, 0.06]"] if line == "dark: background" else []
        (tmp_path / "changed.yaml").write_text("\n".join([*others, *extra, line]))
        ended = labrig("plan", "./changed.yaml", "--rig", "sim")
        assert ended.code == 0, (line, ended.err)


def is_choice(line: str) -> bool:
    """A whole key that is commented out."""
    head, _, _ = line.removeprefix("# ").partition(":")
    return line.startswith("# ") and head.isidentifier() and ": " in line
