"""A file of the wrong kind: its reader names its kind, the one expected, and where that is."""

from collections.abc import Callable
from pathlib import Path

import pytest

from labrig.acquire import read_protocol, read_rig_file
from labrig.calibration import kinds
from labrig.catalogue import find_run
from labrig.design import read_wish
from labrig.foundation import file_kind, resources
from labrig.foundation.errors import LabrigError
from labrig.foundation.file_kind import FileKind, kind_of
from labrig.material import read_any_material
from labrig.optics import read_checked_curves
from labrig.queue import read_queue
from labrig.reduce import read_raw
from labrig.reproduce import read_scene
from labrig.results import read_series

#: Beginnings of files, each of one kind.
FILES: dict[str, tuple[FileKind, bytes]] = {
    "protocol.yaml": (file_kind.PROTOCOL, b"# a decay\nprotocol: decay\ncharge: 5 min\n"),
    "rig.yaml": (file_kind.RIG, b"name: bench\ndevices:\n  lamp: {driver: numato}\n"),
    "material.yaml": (file_kind.MATERIAL, b"name: paint\nkind: phosphor\n"),
    "scene.yaml": (file_kind.SCENE, b"name: box\nkind: scene\n"),
    "wish.yaml": (file_kind.WISH, b"light: [{at: 0 s, light: D65}]\nkeys: []\n"),
    "queue.yaml": (file_kind.QUEUE, b"runs: []\n"),
    "lvf.yaml": (file_kind.CALIBRATION, b"kind: lvf\n"),
    "provenance.yaml": (file_kind.PROVENANCE, b"labrig: 0.1.0\nlibraries:\n  numpy: 2\n"),
    "series.csv": (file_kind.TABLE, b"t_s,R\n0,1\n1,0.5\n"),
    "report.html": (file_kind.REPORT, b"<!DOCTYPE html>\n<html lang='en'><td>1</td></html>\n"),
    "result.json": (file_kind.RESULT, b'{\n"kind": "decay",\n"schema_version": 1}\n'),
    "journal.jsonl": (file_kind.JOURNAL, b'["start", {}]\n'),
    "figure.png": (file_kind.PICTURE, b"\x89PNG\r\n\x1a\n\0\0"),
    "figures.pdf": (file_kind.DOCUMENT, b"%PDF-1.7\n"),
    "run.nxs": (file_kind.NEXUS, b"\x89HDF\r\n\x1a\n"),
    "frame.dng": (file_kind.PHOTOGRAPH, b"II*\0\x08\0\0\0"),
}
READERS: dict[str, tuple[FileKind, Callable[[Path], object], set[FileKind]]] = {
    "protocol": (file_kind.PROTOCOL, read_protocol, set()),
    "rig": (file_kind.RIG, read_rig_file, set()),
    "material": (file_kind.MATERIAL, read_any_material, {file_kind.TABLE, file_kind.PICTURE}),
    "scene": (file_kind.SCENE, read_scene, set()),
    "wish": (file_kind.WISH, read_wish, set()),
    "queue": (file_kind.QUEUE, read_queue, set()),
    "curves": (file_kind.CURVES, read_checked_curves, {file_kind.TABLE}),
    "table": (file_kind.TABLE, read_series, set()),
    "photograph": (file_kind.PHOTOGRAPH, read_raw, {file_kind.PICTURE}),
    "run": (file_kind.RUN, lambda path: find_run(path, path.parent), set()),
}


@pytest.fixture
def files(tmp_path: Path) -> dict[FileKind, Path]:
    written = {}
    for name, (kind, content) in FILES.items():
        written[kind] = tmp_path / name
        written[kind].write_bytes(content)
    return written


def test_each_kind_is_recognised(files: dict[FileKind, Path]) -> None:
    assert {kind: kind_of(path) for kind, path in files.items()} == {kind: kind for kind in files}


def test_what_is_shipped_is_recognised_and_read() -> None:
    places = {
        "config": file_kind.RIG,
        "config/materials": file_kind.MATERIAL,
        "config/fluorescent": file_kind.MATERIAL,
        "config/scenes": file_kind.SCENE,
        resources.PROTOCOLS: file_kind.PROTOCOL,
    }
    for place, kind in places.items():
        assert {kind_of(path) for path in resources.names(place).values()} == {kind}
    assert {file_kind._BY_KIND[kind.name] for kind in kinds()} == {file_kind.CALIBRATION}
    cameras = resources.names("config/optics/cameras").values()
    assert {kind_of(path) for path in cameras} == {None}


@pytest.mark.parametrize("reader", READERS)
def test_a_file_of_another_kind_is_named_with_the_kind_expected(
    reader: str, files: dict[FileKind, Path]
) -> None:
    expected, read, also = READERS[reader]
    for kind, path in files.items():
        if kind is expected or kind in also:
            continue
        with pytest.raises(LabrigError) as caught:
            read(path)
        assert f"{path}: this is {kind.name}" in str(caught.value)
        assert f"; {expected.name} is expected" in str(caught.value)


def test_a_run_folder_has_what_is_expected_and_a_file_lies_in_a_run(tmp_path: Path) -> None:
    run = tmp_path / "2026_decay"
    (run / "result").mkdir(parents=True)
    for name in ("protocol.yaml", "rig.yaml"):
        (run / name).write_bytes(FILES[name][1])
    (run / "result" / "series.csv").write_bytes(FILES["series.csv"][1])
    for read, place in ((read_rig_file, "rig.yaml"), (read_series, "result/series.csv")):
        with pytest.raises(LabrigError) as caught:
            read(run)
        assert "this is a run folder" in str(caught.value)
        assert str(caught.value).endswith(f", see {run / place}")
    for inside in (run / "result" / "series.csv", run / "result"):
        with pytest.raises(LabrigError) as caught:
            find_run(inside, tmp_path)
        assert str(caught.value).endswith(str(run))


def test_a_file_of_no_kind_is_left_to_its_reader(tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"
    path.write_text("name: bench\ndevces:\n  lamp: {driver: numato}\n")
    assert kind_of(path) is None
    with pytest.raises(LabrigError, match="unknown key 'devces'; did you mean 'devices'"):
        read_rig_file(path)
    assert kind_of(tmp_path / "missing.yaml") is None
    assert kind_of(tmp_path) is None
