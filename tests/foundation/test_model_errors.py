"""Refusals of a file's model are plain words: where, what was expected, what came."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings, strategies as st
from pydantic import BaseModel

from labrig.acquire import DeviceEntry, RigFile
from labrig.foundation import plugins, resources
from labrig.foundation.errors import UsageError
from labrig.foundation.yaml_file import parse_yaml, read_yaml, validate
from labrig.material import Material
from labrig.sim import Simulation

Content = dict[str, Any]
#: Words of pydantic that mean nothing to who writes a file.
JARGON = re.compile(
    r"Input should|valid |[Tt]uple|instance of|[Dd]ictionary|unable to|parse|literal|validation"
    r"|another value|items? after|None|dict\b|float|str\b|\bint\b"
)
DECAY = {"protocol": "decay", "sample": {"name": "paint"}}
CONTENTS: dict[str, list[Content]] = {
    place: [read_yaml(path) for path in resources.names(place).values()]
    for place in ("protocols", "config", "config/materials")
}
FILES: list[tuple[type[BaseModel], Content]] = [
    *(
        (plugins.measurement(content["protocol"], "test").load("protocol"), content)
        for content in CONTENTS["protocols"]
    ),
    *((RigFile, content) for content in CONTENTS["config"]),
    *((Material, content) for content in CONTENTS["config/materials"]),
    *(
        (Simulation, content["simulation"])
        for content in CONTENTS["config"]
        if "simulation" in content
    ),
    *(
        (plugins.load(plugins.DRIVERS, entry["driver"], "test").Settings, keys)
        for content in CONTENTS["config"]
        for entry in content["devices"].values()
        if (keys := {key: entry[key] for key in entry if key not in DeviceEntry.model_fields})
    ),
]
ODD: st.SearchStrategy[Any] = st.sampled_from(
    [None, True, -1, 0, 1, 7, 10**400, -0.5, 0.5, 1e300, "", "x", "40%", "5 s", "-5 s", [], [1],
     ["a"], [1, 2, 3], [0, 3, 0, 3, 0, 4, 0, 4], [[]], {}, {"a": 1}, {"a": {"b": []}}, {1: [1]}]
)  # fmt: skip


def refusal(content: dict[str, Any], model: type[BaseModel] | None = None) -> str:
    with pytest.raises(UsageError) as caught:
        validate(
            content, model or plugins.measurement("decay", "test").load("protocol"), "mine.yaml"
        )
    return str(caught.value)


def places(content: Any, before: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Return where a content has values, from the outside to the inside."""
    if isinstance(content, dict):
        inner = list(content.items())
    elif isinstance(content, list):
        inner = list(enumerate(content))
    else:
        inner = []
    return [
        place for key, value in inner for place in ((*before, key), *places(value, (*before, key)))
    ]


def replaced(content: Any, place: tuple[Any, ...], value: Any) -> Any:
    """Return a content with another value at a place."""
    if not place:
        return value
    items = dict(content) if isinstance(content, dict) else list(content)
    items[place[0]] = replaced(content[place[0]], place[1:], value)
    return items


@settings(max_examples=150, deadline=None)
@given(st.sampled_from(FILES), st.data(), ODD)
def test_no_refusal_of_a_changed_file_has_pydantics_words(
    file: tuple[type[BaseModel], Content], data: st.DataObject, value: Any
) -> None:
    model, content = file
    changed = replaced(content, data.draw(st.sampled_from(places(content))), value)
    try:
        validate(changed, model, "mine.yaml")
    except UsageError as error:
        said = str(error).replace(f"got '{value}'", "")
        assert not JARGON.search(said), said
        assert "\n" not in said


@pytest.mark.parametrize(
    ("region", "received"),
    [
        ([0, 3, 0, 3, 0, 4, 0, 4], "got [0, 3, 0, 3, 0, 4, 0, 4]"),
        ([30, 30, 40], "got [30, 30, 40]"),
        ([30, 30, "40%", 40], "got [30, 30, 40%, 40]"),
        ("middle", "got 'middle'"),
    ],
)
def test_a_region_is_four_numbers(region: object, received: str) -> None:
    expected = "four numbers x, y, width, height, in pixels or all as fractions of the frame"
    assert refusal({**DECAY, "patches": {"a": region}}) == (
        f"mine.yaml: patches.a: expected {expected}, {received}"
    )


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        ({"sample": ["a", "b"]}, "sample: {name: "),
        ({"repeats": "many"}, "repeats: expected a whole number, got 'many'"),
        ({"repeats": 0}, "repeats: expected a number of at least 1, got '0'"),
        ({"states": 4}, "states: expected 'auto', 1, 2 or 3, got '4'"),
        ({"camera": [1]}, "camera: expected 'key: value' lines with iso, f_number, got a list"),
        ({"daylight": "perhaps"}, "daylight: expected true or false, got 'perhaps'"),
    ],
)
def test_a_refusal_names_what_was_expected(content: dict[str, Any], expected: str) -> None:
    assert expected in refusal(DECAY | content)


def test_the_types_of_a_union_are_told_together() -> None:
    rig = read_yaml(resources.find("config", "rig", "sim")) | {"on_finish": 5}
    assert refusal(rig, RigFile).endswith("on_finish: expected 'bell' or a list, got '5'")


class Frame(BaseModel):
    pixels: tuple[int, int]


def test_a_list_that_is_too_short_or_too_long_is_counted() -> None:
    assert refusal({"pixels": [3]}, Frame).endswith("pixels: expected 2 values, got 1")
    said = refusal({"pixels": [1, 2, 3]}, Frame)
    assert said.endswith("pixels: expected at most 2 values, got 3")


@pytest.mark.parametrize("line", ["\tname: paint", "  \tname: paint", "\t- paint"])
def test_a_tab_is_named(line: str) -> None:
    with pytest.raises(UsageError, match=r"line 2: expected spaces.* got a tab"):
        parse_yaml(f"sample:\n{line}\n", "mine.yaml")


@pytest.fixture
def plan_refusal(labrig: Callable[..., Any], tmp_path: Path) -> Callable[[str], str]:
    def plan(text: str) -> str:
        (tmp_path / "mine.yaml").write_text(text)
        ended = labrig("plan", tmp_path / "mine.yaml", "--rig", "sim")
        assert ended.code == 2
        return str(ended.err)

    return plan


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        ("every: 0.5 s\nexposure: 0.5 s", "every: "),
        ("camera: {iso: 450}", "ISO 450"),
        ("patches: {a: [5000, 100, 50, 50]}", "1404 × 936"),
        ("patches: {a: [0.5, 0.5, 0.0001, 0.0001]}", "at least 100 pixels, got 2 × 2"),
    ],
)
def test_what_the_rig_cannot_is_named_with_the_file(
    keys: str, expected: str, plan_refusal: Callable[[str], str]
) -> None:
    said = plan_refusal(f"protocol: decay\ncharge: 5 min\nfor: 60 s\n{keys}\n")
    assert "mine.yaml: " in said
    assert expected in said
