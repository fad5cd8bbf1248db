"""The JSON Schemas say of a file what labrig itself says of it."""

import copy
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from labrig.foundation import resources
from labrig.foundation.yaml_file import read_yaml
from labrig.schema import KINDS, schema
from tests.conftest import Ended

SHIPPED = [
    (kind, path)
    for kind, place in (
        ("protocol", "protocols"),
        ("rig", "config"),
        ("material", "config/materials"),
        ("scene", "config/scenes"),
    )
    for path in resources.names(place).values()
]
#: Mappings whose keys are names that a person chooses, and a chain's parts: those are checked by
#: their own protocols when the file is read.
FREE = (
    "patches", "parts", "channels", "lamps", "fluorescence", "materials", "objects", "samples"
)  # fmt: skip


@pytest.fixture(scope="module")
def validators() -> dict[str, Draft202012Validator]:
    made = {kind: schema(kind) for kind in KINDS}
    for one in made.values():
        Draft202012Validator.check_schema(one)
    return {kind: Draft202012Validator(one) for kind, one in made.items()}


@pytest.mark.parametrize(("kind", "path"), SHIPPED, ids=[path.stem for _, path in SHIPPED])
def test_what_is_shipped_is_valid_and_every_misspelt_key_is_not(
    kind: str, path: Path, validators: dict[str, Draft202012Validator]
) -> None:
    content = read_yaml(path)
    validators[kind].validate(content)
    # Of a list of things that are alike, one.
    alike = {tuple(key for key in place if isinstance(key, str)): place for place in keys(content)}
    places = list(alike.values())
    assert places
    for place in places:
        assert not validators[kind].is_valid(misspelt(content, place)), place


@pytest.mark.parametrize(
    ("kind", "changes"),
    [
        ("protocol", {"every": 5}),
        ("protocol", {"every": "5 apples"}),
        ("protocol", {"charge": "platform"}),
        ("protocol", {"states": 4}),
        ("rig", {"devices": {"lamp": {"driver": "nobodys_relay", "address": "COM3"}}}),
        ("rig", {"devices": {"lamp": {"driver": "numato", "relay": 0}}}),
        ("rig", {"devices": {"lamp": {"driver": "ptp_camera", "address": "COM3"}}}),
        ("rig", {"simulation": {"sample": "blue-paint", "faults": ["lamp_daed"]}}),
        ("rig", {"simulation": {"sample": "blue-paint", "faults": [{"lamp_dead": {"at": 5}}]}}),
        ("material", {"kind": "gas"}),
        ("material", {"states": []}),
        ("scene", {"objects": {}}),
        ("scene", {"lamps": {"sun": {"kind": "laser"}}}),
    ],
)
def test_what_labrig_refuses_an_editor_underlines(
    kind: str, changes: dict[str, Any], validators: dict[str, Draft202012Validator]
) -> None:
    place, name = {
        "protocol": ("protocols", "decay"),
        "rig": ("config", "sim"),
        "material": ("config/materials", "blue-paint"),
        "scene": ("config/scenes", "cornell-box"),
    }[kind]
    content = read_yaml(resources.find(place, kind, name))
    assert not validators[kind].is_valid(content | changes)


@pytest.mark.parametrize(
    "faults", [["lamp_dead"], [{"camera_unplugged": {"at": "5 min", "for": "20 s"}}]]
)
def test_what_labrig_takes_an_editor_takes(
    faults: list[Any], validators: dict[str, Draft202012Validator]
) -> None:
    rig = read_yaml(resources.folder("config") / "sim.yaml")
    rig["simulation"]["faults"] = faults
    assert validators["rig"].is_valid(rig)
    rig["simulation"]["faults"] = [*faults, "lamp_daed"]
    assert not validators["rig"].is_valid(rig)


@pytest.mark.parametrize("kind", KINDS)
def test_every_key_is_described(kind: str, validators: dict[str, Draft202012Validator]) -> None:
    for name, key in properties(validators[kind].schema):
        description = key.get("description", "")
        assert description[:1].isupper(), name
        assert description.endswith("."), name


@pytest.mark.parametrize("kind", KINDS)
def test_every_default_may_be_written(
    kind: str, validators: dict[str, Draft202012Validator]
) -> None:
    described = properties(validators[kind].schema)
    defaults = [(name, key) for name, key in described if "default" in key]
    assert defaults
    for name, key in defaults:
        assert validators[kind].evolve(schema=key).is_valid(key["default"]), name


def test_keys_are_described_by_the_models_and_their_base_classes(
    validators: dict[str, Draft202012Validator],
) -> None:
    protocols = validators["protocol"].schema["$defs"]
    every = protocols["Decay"]["properties"]["every"]
    assert every["description"] == (
        "Time between the begins of two photographs, in the mean, for example `5 s`."
    )
    assert every["default"] == "5 s"
    assert every["markdownDescription"] == every["description"]
    assert "saturated" in protocols["Isotropy"]["properties"]["charge"]["description"]
    rig = validators["rig"].schema["$defs"]
    assert "rig check" in rig["ptp_camera"]["properties"]["shutter_lag"]["description"]
    assert (
        "until the device is steady" in rig["lcus_as_lamp"]["properties"]["warm_up"]["description"]
    )
    name, with_times = rig["Fault"]["anyOf"]
    assert "for ever" in name["description"]
    assert "bulb" in with_times["properties"]["lamp_dead"]["description"]


def test_the_command_prints_it(labrig: Callable[..., Ended]) -> None:
    ended = labrig("schema", "rig")
    assert ended.code == 0
    assert json.loads(ended.out)["title"] == "labrig rig"
    refused = labrig("schema", "rigg")
    assert (refused.code, len(refused.err.splitlines())) == (2, 1)
    assert "did you mean 'rig'" in refused.err


def properties(schema: Any, place: str = "") -> Iterator[tuple[str, dict[str, Any]]]:
    """Every property of a schema and of its definitions, with a name for messages."""
    if isinstance(schema, dict):
        for name, key in schema.get("properties", {}).items():
            yield f"{place}.{name}", key
        for part, inner in schema.items():
            if part not in ("default", "enum", "const", "discriminator"):
                yield from properties(inner, part if part not in ("properties", "items") else place)
    elif isinstance(schema, list):
        for inner in schema:
            yield from properties(inner, place)


def keys(content: Any, place: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    if isinstance(content, dict):
        for key, value in content.items():
            if not set(FREE).intersection(place):
                yield (*place, key)
            yield from keys(value, (*place, key))
    elif isinstance(content, list):
        for number, value in enumerate(content):
            yield from keys(value, (*place, number))


def misspelt(content: Any, place: tuple[Any, ...]) -> Any:
    changed = copy.deepcopy(content)
    inner = changed
    for part in place[:-1]:
        inner = inner[part]
    inner[f"{place[-1]}x"] = inner.pop(place[-1])
    return changed
