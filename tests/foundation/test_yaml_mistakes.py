"""Mistakes in files that people write: the line of the mistake, its cause, examples in its unit."""

import re
from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from labrig.acquire import driver_and_settings, read_protocol, read_rig_file
from labrig.foundation.errors import UsageError
from labrig.foundation.yaml_file import parse_yaml

RIG = """name: dark room
devices:
  lamp:
    driver: numato
    address: COM3
    relay: 0
  camera: {driver: ptp_camera, isos: [100, 200]}
"""
#: Text to be replaced, what a person wrote instead, line of the mistake, and a part of its cause.
MISTAKES = [
    ("driver: numato", "driver numato", 4, "lacks a colon and a blank"),
    ("driver: numato", "driver:numato", 4, "lacks a blank after the colon"),
    ("relay: 0", "relay:0", 6, "lacks a blank after the colon"),
    ("devices:\n", "devices\n", 2, "lacks a colon"),
    ("COM3", "COM3: 5", 5, "two colons"),
    ("dark room", "dark room: left", 1, "two colons"),
    ("dark room", "'dark room", 1, "quotation mark"),
    ("dark room", '"dark room', 1, "quotation mark"),
    ("dark room", "@home", 1, "no value begins with '@'"),
    ("dark room", "%home", 1, "no value begins with '%'"),
    ("dark room", "*home", 1, "marked by '&'"),
    ("    address", "      address", 5, "indented more than 'driver: numato'"),
    ("    relay", "   relay", 6, "indented otherwise"),
    ("    relay", "\t relay", 6, "spaces"),
    ("200]}", "200}", 7, "[…]"),
    ("200]}", "200]", 7, "'{' is opened here"),
    ("100, 200", "100 200", 7, ""),
    ("ptp_camera, isos", "ptp_camera isos", 7, "expected ','"),
    ("  lamp:\n", "  - lamp\n  lamp:\n", 4, "list"),
]


@pytest.mark.parametrize(("written", "instead", "line", "cause"), MISTAKES)
def test_a_mistake_is_named_at_its_own_line(
    written: str, instead: str, line: int, cause: str
) -> None:
    text = RIG.replace(written, instead, 1)
    assert text != RIG
    if not cause:  # a text of two numbers is a value, which the model refuses
        assert parse_yaml(text, "rig.yaml")["devices"]["camera"]["isos"] == ["100 200"]
        return
    with pytest.raises(UsageError) as caught:
        parse_yaml(text, "rig.yaml")
    message = str(caught.value)
    assert message.startswith(f"rig.yaml, line {line}: "), message
    assert cause in message
    assert "\n" not in message


@given(st.integers(0, len(RIG) - 1), st.sampled_from([*":{]'-\t*", "", "  "]))
def test_any_slip_of_the_pen_is_read_or_refused_in_a_line_of_the_text(
    place: int, instead: str
) -> None:
    text = RIG[:place] + instead + RIG[place + 1 :]
    try:
        parse_yaml(text, "rig.yaml")
    except UsageError as error:
        message = str(error)
        assert "\n" not in message
        line = re.match(r"rig\.yaml, line (\d+): ", message)
        assert message.startswith("rig.yaml: expected") or (
            line is not None and 1 <= int(line[1]) <= text.count("\n") + 1
        )


@given(st.text(alphabet="ab:-{}[],'\"#&*!|>%@\t\n ", max_size=40))
def test_any_text_is_read_or_refused(text: str) -> None:
    try:
        parse_yaml(text, "rig.yaml")
    except UsageError as error:
        assert str(error).startswith("rig.yaml")
        assert "\n" not in str(error)


DOOR = "name: x\ndevices:\n  door: {{driver: maestro, address: COM4, channel: 0, {}}}\n"
#: Keys of a door, and what is said of them.
UNITS = [
    ("closed: 1000, open: 2000 us, travel: 300 ms", "such as '1000 us', got '1000'"),
    ("closed: 1000 mm, open: 2000 us, travel: 300 ms", "such as '1000 us', got '1000 mm'"),
    ("closed: 1000 ms, open: 2000 us, travel: 300 ms", "at most 4080 us, got '1000 ms'"),
    ("closed: 1000 us, open: 2000 us, travel: 300", "such as '300 ms', got '300'"),
    ("closed: 1000 us, open: 2000 us, travel: fast", "such as '300 ms', got 'fast'"),
]


@pytest.mark.parametrize(("keys", "said"), UNITS)
def test_an_example_has_the_unit_of_the_key(tmp_path: Path, keys: str, said: str) -> None:
    path = tmp_path / "rig.yaml"
    path.write_text(DOOR.format(keys))
    with pytest.raises(UsageError) as caught:
        driver_and_settings(read_rig_file(path), "door", str(path))
    assert str(caught.value).endswith(said)


def test_keys_of_protocols_and_fractions_have_examples_too(tmp_path: Path) -> None:
    path = tmp_path / "file.yaml"
    cases = {
        "protocol: decay\ncharge: 90\n": "such as '90 min'",
        "protocol: decay\nexposure: 1\n": "such as '1 s'",
        "protocol: decay\nsample: {thickness: 400}\n": "such as '400 mm'",
        "protocol: decay\nplateau: {growth: 5}\n": "less than 100 %, such as '5 %'",
    }
    for text, said in cases.items():
        path.write_text(text)
        with pytest.raises(UsageError) as caught:
            read_protocol(path)
        assert said in str(caught.value)
    path.write_text("name: x\ndevices:\n  lamp: {driver: numato, address: COM3, warm_up: 15}\n")
    with pytest.raises(UsageError, match="such as '15 min', got '15'"):
        read_rig_file(path)
