"""What a YAML file names by a path lies beside it; nothing else becomes a path."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Literal

import pytest
import yaml
from pydantic import BaseModel, Field

import labrig
from labrig.acquire import changes_with_absolute_paths
from labrig.bench import with_frame_size
from labrig.foundation.named_files import FilePath, ShippedOrFile, is_path, with_absolute_paths
from labrig.optics import read_light
from labrig.protocols.luminance.protocol import Luminance

LAB = Path("/lab")


class Lamp(BaseModel):
    kind: Literal["lamp"]
    spectrum: ShippedOrFile
    label: str = ""


class Marker(BaseModel):
    kind: Literal["marker"]
    text: str


class Bench(BaseModel):
    """As a third party may write a model."""

    name: str
    table: Path | None = None
    run: FilePath | None = None
    lights: tuple[Lamp | Marker, ...] = ()
    cards: dict[str, ShippedOrFile] = {}
    curves: Annotated[list[Annotated[FilePath, Field(min_length=1)]], Field(min_length=1)] = []
    file: FilePath | None = Field(None, alias="from")


def test_only_keys_that_name_files_become_paths() -> None:
    content = {
        "name": "batch-3.1",
        "table": "sub/table.csv",
        "run": "run-7",
        "lights": [
            {"kind": "lamp", "spectrum": "lamp.csv", "label": "lamp.csv"},
            {"kind": "lamp", "spectrum": "FL3.15"},
            {"kind": "marker", "text": "lamp.csv"},
        ],
        "cards": {"left.csv": "left.csv", "right": "grey_card_18"},
        "curves": ["a.csv", "/elsewhere/b.csv"],
        "from": "./here",
        "unknown": "a.csv",
    }
    assert with_absolute_paths(content, Bench, LAB) == {
        "name": "batch-3.1",
        "table": str(LAB / "sub/table.csv"),
        "run": str(LAB / "run-7"),
        "lights": [
            {"kind": "lamp", "spectrum": str(LAB / "lamp.csv"), "label": "lamp.csv"},
            {"kind": "lamp", "spectrum": "FL3.15"},
            {"kind": "marker", "text": "lamp.csv"},
        ],
        "cards": {"left.csv": str(LAB / "left.csv"), "right": "grey_card_18"},
        "curves": [str(LAB / "a.csv"), "/elsewhere/b.csv"],
        "from": str(LAB / "here"),
        "unknown": "a.csv",
    }


@pytest.mark.parametrize("content", [{"lights": "lamp.csv"}, {"name": ["a.csv"]}, {"cards": None}])
def test_malformed_content_is_left_to_the_model(content: dict[str, object]) -> None:
    assert with_absolute_paths(content, Bench, LAB) == content


def test_the_home_folder_is_known() -> None:
    assert with_absolute_paths({"run": "~/runs/7"}, Bench, LAB) == {
        "run": str(Path.home() / "runs/7")
    }
    assert with_absolute_paths({"run": "~nobody-is-called-so/7"}, Bench, LAB) == {
        "run": str(LAB / "~nobody-is-called-so/7")
    }


@pytest.mark.parametrize(
    "name", ["batch-3.1", "a/b", "../other", "~", "C:\\samples", "notes.txt", "lamp"]
)
def test_a_sample_keeps_its_name_whatever_lies_beside(
    make_protocol: Callable[..., Path], tmp_path: Path, name: str
) -> None:
    for there in ("batch-3.1", "a/b", "lamp", "C:\\samples"):
        (tmp_path / there).mkdir(parents=True)
    (tmp_path / "notes.txt").touch()
    path = make_protocol(sample={"name": name})
    assert labrig.read_protocol(path).sample.name == name


def test_changes_are_found_from_the_folder_that_is_told() -> None:
    typed = {"emission": "green.csv", "sample.name": "batch.a", "sample": {"name": "b.c"}}
    assert changes_with_absolute_paths(typed, Luminance, LAB) == typed | {
        "emission": str(LAB / "green.csv")
    }


def test_names_of_a_rig_stay_and_its_files_are_found(
    make_rig: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Folders called as the driver, the lamp and an answer of the board; another working folder."""
    for there in ("numato", "halogen_3000k", "ok/1", "canon_eos_5d_mark_ii", "blue-paint"):
        (tmp_path / there).mkdir(parents=True)
    material = tmp_path / "paint.yaml"
    shipped = Path(labrig.__file__).parent.resolve() / "config/materials/blue-paint.yaml"
    material.write_bytes(shipped.read_bytes())
    path = make_rig(sample="paint.yaml")
    content = yaml.safe_load(path.read_text(encoding="utf-8"))
    content["name"] = "ok/1"
    content["optics"] = {
        "camera": "canon_eos_5d_mark_ii", "lamp": "halogen_3000k", "grey_card": "cards/grey.csv",
        "camera_file": "run-3",
    }  # fmt: skip
    content["devices"]["leds"] = {
        "driver": "serial_relay", "address": "sim://room/arduino",
        "channels": {"a.csv": {"on": "ok/1", "off": "off", "spectrum": "a.csv"}},
    }  # fmt: skip
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    monkeypatch.chdir("/")

    rig = labrig.read_rig_file(path)
    assert rig.name == "ok/1"
    assert (rig.optics.camera, rig.optics.lamp) == ("canon_eos_5d_mark_ii", "halogen_3000k")
    assert rig.optics.grey_card == str(tmp_path / "cards/grey.csv")
    assert rig.optics.model_dump()["camera_file"] == str(tmp_path / "run-3")
    assert rig.devices["leds"].settings()["channels"] == {
        "a.csv": {"on": "ok/1", "off": "off", "spectrum": str(tmp_path / "a.csv")}
    }
    room = with_frame_size(rig, str(path)).simulation
    assert room is not None
    assert room["sample"] == str(material)


def test_a_shipped_light_is_taken_though_a_file_is_called_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "D65").write_text("no spectrum", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    assert read_light("D65").at([560.0]) == pytest.approx(100.0)


@pytest.mark.parametrize(
    ("named", "is_one"),
    [("a.csv", True), ("./a", True), ("a/b", True), ("a", False), ("3.1", False), ("", False)],
)
def test_what_is_a_path(named: str, is_one: bool) -> None:
    assert is_path(named) == is_one
