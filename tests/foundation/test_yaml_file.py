"""YAML as people write it: 1.2 scalars, no duplicate keys, one clear line when it is wrong."""

from itertools import pairwise
from pathlib import Path
from time import process_time

import pytest
from hypothesis import example, given, strategies as st
from pydantic import BaseModel, ConfigDict

from labrig.foundation.errors import UsageError
from labrig.foundation.yaml_file import (
    did_you_mean,
    parse_yaml,
    read_model,
    validate,
    write_yaml,
    yaml_text,
)


class Inner(BaseModel):
    model_config = ConfigDict(extra="forbid")
    exposure: float = 1.0
    iso: int = 100


class Outer(BaseModel):
    model_config = ConfigDict(extra="forbid")
    name: str
    camera: Inner = Inner()
    devices: dict[str, Inner] = {}


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-3", 1e-3),
        ("1:30", "1:30"),
        ("0100", "0100"),
        ("0x1F", "0x1F"),
        ("no", "no"),
        ("off", "off"),
        ("true", True),
        ("~", None),
        ("", None),
        ("12", 12),
        ("-3", -3),
        ("1.5", 1.5),
        (".5", 0.5),
        ("5 s", "5 s"),
        ("1_000", "1_000"),
        ("2026-01-01", "2026-01-01"),
    ],
)
def test_scalars_are_those_of_yaml_1_2(text: str, value: object) -> None:
    read = parse_yaml(f"key: {text}", "test")["key"]
    assert read == value
    assert type(read) is type(value)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("name: a\nname: b", "'name' stands twice"),
        ("- a", "a list"),
        ("just words", "'just words'"),
        ("a: [1", "line 1"),
        ("\t- x", "test"),
    ],
)
def test_malformed_text_is_one_clear_line(text: str, expected: str) -> None:
    with pytest.raises(UsageError, match="test") as caught:
        parse_yaml(text, "test")
    assert expected in str(caught.value)
    assert "\n" not in str(caught.value)


BOMB = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{name}: &{name} [{', '.join(9 * [f'*{before}'])}]\n" for before, name in pairwise("abcdefghi")
)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (BOMB, "aliases"),
        ("a: &a [*a]", "within what it stands for"),
        ("a: &a {b: {c: *a}}", "within what it stands for"),
        ("a: " + "[" * 5000, "deep"),
        (
            "a: &a [[[[[[[[[[[[[[[x]]]]]]]]]]]]]]]\nb: [[[[[[[[[[[[[[[[[*a]]]]]]]]]]]]]]]]]",
            "aliases",
        ),
        ("a: !!timestamp x", "!!timestamp"),
        ("a: !!bool x", "!!bool"),
        ("a: !!python/object/apply:os.getcwd []", "tag"),
        ("a: !mine [b]", "tag"),
        ("a: .inf", "finite"),
        ("a: -.INF", "finite"),
        ("a: .nan", "finite"),
        ("a: 1e400", "finite"),
        ("a: " + "9" * 5000, "digits"),
        ('a: "\\ud800"', "character"),
        ('a: "b\\0c"', "text"),
        ("? [a]\n: b", "key"),
    ],
)
def test_what_no_file_needs_is_refused_at_once(text: str, expected: str) -> None:
    began_s = process_time()
    with pytest.raises(UsageError, match="test") as caught:
        parse_yaml(text, "test")
    assert process_time() - began_s < 2.0
    assert expected in str(caught.value)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 300


def test_an_alias_is_what_it_stands_for() -> None:
    read = parse_yaml("a: &here [0.1, 0.2, 0.3, 0.4]\nb: {c: *here}", "test")
    assert read == {"a": [0.1, 0.2, 0.3, 0.4], "b": {"c": [0.1, 0.2, 0.3, 0.4]}}


def test_a_file_without_end_is_refused(tmp_path: Path) -> None:
    (tmp_path / "long.yaml").write_text("a: b\n" + "# more\n" * 800_000)
    with pytest.raises(UsageError, match="at most"):
        read_model(tmp_path / "long.yaml", Outer)


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        ({"nam": "x"}, "unknown key 'nam'; did you mean 'name'?"),
        ({"name": "x", "camera": {"exposur": 1}}, "did you mean 'exposure'?"),
        ({"name": "x", "devices": {"a": {"isoo": 1}}}, "did you mean 'iso'?"),
        ({}, "the key 'name' is missing"),
        ({"name": "x", "camera": {"iso": "many"}}, "camera.iso"),
        ({"name": "x", "camera": [1]}, "camera"),
    ],
)
def test_a_misfit_names_the_key_and_the_remedy(content: dict[str, object], expected: str) -> None:
    with pytest.raises(UsageError) as caught:
        validate(content, Outer, "here.yaml")
    assert str(caught.value).startswith("here.yaml: ")
    assert expected in str(caught.value)


def test_a_missing_or_binary_file_is_reported(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no such file"):
        read_model(tmp_path / "none.yaml", Outer)
    (tmp_path / "photo.yaml").write_bytes(b"\xff\xd8\xff\xe0")
    with pytest.raises(UsageError, match="UTF-8"):
        read_model(tmp_path / "photo.yaml", Outer)


def test_a_model_written_is_read_back(tmp_path: Path) -> None:
    model = Outer(name="λ: 450", camera=Inner(exposure=0.1 + 0.2))
    write_yaml(tmp_path / "x.yaml", model)
    assert read_model(tmp_path / "x.yaml", Outer) == model


def test_an_unknown_word_with_nothing_near_lists_what_is_known() -> None:
    assert did_you_mean("zzz", ["decay", "blank"]) == "known: blank, decay"


@given(st.text())
@example("0\n0")
def test_any_text_is_a_mapping_or_one_line(text: str) -> None:
    try:
        assert isinstance(parse_yaml(text, "test"), dict)
    except UsageError as error:
        assert "\n" not in str(error)


@given(st.floats(allow_nan=False, allow_infinity=False), st.integers(-(10**15), 10**15))
def test_numbers_survive_writing(real: float, whole: int) -> None:
    assert parse_yaml(yaml_text({"a": real, "b": whole}), "test") == {"a": real, "b": whole}


@pytest.mark.parametrize(
    "text", ["0E0", "1e-3", "1e5", "no", "~", "0x10", "1:30", "0100", "", " a"]
)
def test_text_that_looks_like_something_else_comes_back_as_text(text: str) -> None:
    assert parse_yaml(yaml_text({"name": text}), "file") == {"name": text}
