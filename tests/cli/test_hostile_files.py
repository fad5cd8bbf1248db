"""Some of the hostile files, each with the command that reads its kind: refused in one quick line.

`tests/acceptance/hostile_files.py` has all of them with all commands.
"""

import os
import socket
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from tests.hostile_files import MAKERS, Listener, Stage, opened, scenes_of, watched

#: The command that reads each kind of file, and files of the kind that take long to be made.
COMMANDS = {
    "rig": "rig check FILE",
    "yaml": "plan PROTOCOL --rig FILE",
    "protocol": "plan FILE --rig RIG",
    "table": "fit decay FILE",
    "json": "optics show FILE",
    "matrix": "material show FILE",
    "arrays": "render texture.yaml --paths 1",
    "mesh": "render mesh.yaml --paths 1",
    "picture": "render picture.yaml --paths 1",
    "frame": "frame FILE",
    "scene": "render FILE --paths 1",
    "queue": "queue run --queue FILE",
    "runs": "runs list --runs FILE",
    "run": "resume FILE --no-process",
    "folder": "fit decay FILE",
}
SLOW = {
    "table_of_very_many_cells", "table_of_very_many_rows", "json_of_very_many_lists",
    "npz_that_unpacks_to_gigabytes", "exr_of_zeros", "obj_of_many_corners", "yaml_of_many_values",
    "yaml_of_a_long_text_many_times", "rig_with_a_command",
}  # fmt: skip
#: Files like others of their kind.
ALIKE = {
    "rig_that_empties_a_file", "rig_that_calls_a_socket_in_capitals", "rig_with_another_class",
    "rig_that_searches_ports", "rig_whose_viewfinder_is_far", "yaml_that_is_deep", "ark_of_a_pipe",
    "yaml_that_is_a_pipe", "table_without_end", "bfc_of_stated_size", "npy_whose_header_lies",
    "gltf_whose_buffer_is_far", "stl_of_stated_size", "obj_that_is_a_pipe", "png_that_is_a_pipe",
    "frame_that_is_a_pipe", "dng_of_many_tags", "run_whose_log_txt_leads_out",
    "run_whose_notes_md_leads_out", "run_whose_result_part_leads_out", "run_with_a_command",
    "run_whose_comparison_leads_out", "run_whose_lock_leads_out", "run_whose_result_leads_out",
    "run_whose_process_holder_leads_out", "run_whose_result_figures_leads_out",
    "run_whose_frames_leads_out", "run_whose_result_is_deep", "run_with_names_that_lead_out",
}  # fmt: skip
FILES = [
    pytest.param(
        *(kind, name), id=name, marks=[pytest.mark.campaign] if name in SLOW | ALIKE else []
    )
    for kind in COMMANDS
    for name in MAKERS[kind]
]


@pytest.fixture
def listener() -> Iterator[Listener]:
    with closing(Listener()) as listener:
        yield listener


@pytest.fixture
def stage(tmp_path: Path, kept: Path, listener: Listener) -> Stage:
    stage = Stage(tmp_path / "theirs", tmp_path / "outside", listener.port, kept, kept / "rig.yaml")
    for folder in (stage.folder, stage.outside, tmp_path / "home"):
        folder.mkdir()
    stage.mine.write_text("mine")
    return stage


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs processes with all imported")
@pytest.mark.parametrize(("kind", "name"), FILES)
def test_nothing_more_than_a_line(
    stage: Stage, listener: Listener, tmp_path: Path, kind: str, name: str
) -> None:
    home, file = tmp_path / "home", MAKERS[kind][name](stage)
    for scene, text in scenes_of(file).items():
        (home / f"{scene}.yaml").write_text(text)
    given = {"FILE": str(file), "RIG": str(stage.rig), "PROTOCOL": str(stage.run / "protocol.yaml")}
    command = [given.get(word, word) for word in COMMANDS[kind].split()]
    outcome = opened(command, stage, listener, home)
    assert not outcome.wrong, outcome
    assert kind in ("runs", "run", "folder") or outcome.code != 0, outcome


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs processes with all imported")
def test_the_watch_sees_each_deed(
    stage: Stage, listener: Listener, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else the tests above could not fail."""
    monkeypatch.setattr("tests.hostile_files.MAX_BYTES", 1 << 20)

    def write() -> None:
        (stage.outside / "new").write_text("x")

    def call() -> None:
        socket.create_connection(("127.0.0.1", stage.port)).close()

    def start() -> None:
        os.system("true")

    for deed, said in ((write, "outside"), (call, "called"), (start, "os.system"), (call, "MB")):
        outcome = watched(lambda: deed() or 0, False, stage, listener, tmp_path / "home")  # noqa: B023
        assert said in " ".join(outcome.wrong), (said, outcome)
