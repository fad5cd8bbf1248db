"""Keys of a board in the rig file: bytes as text, and one clear line for what is wrong."""

from typing import Any

import pytest
from hypothesis import given, strategies as st

from labrig.acquire import load_driver
from labrig.drivers.serial_relay.settings import wire_text
from labrig.foundation.errors import UsageError
from labrig.foundation.yaml_file import validate

SerialLeds: Any = load_driver("leds", "serial_relay", "rig.yaml")
SerialLamp: Any = load_driver("lamp", "serial_relay", "rig.yaml")

Keys = dict[str, Any]
MINIMAL: Keys = {"on": "1", "off": "0"}


def settings(keys: Keys) -> Any:
    return validate(keys, SerialLamp.Settings, "rig.yaml, devices.lamp")


def escaped(content: bytes) -> str:
    """The shortest and the longest way to write bytes, in turn."""
    return "".join(
        chr(byte) if number % 2 and 32 <= byte != ord("\\") else f"\\x{byte:02X}"
        for number, byte in enumerate(content)
    )


@given(st.binary(min_size=1, max_size=20))
def test_any_bytes_can_be_written_in_three_ways(content: bytes) -> None:
    assert wire_text(escaped(content)).content == content
    assert wire_text(f"hex {content.hex(' ')}").content == content
    assert wire_text(f"hex {content.hex().upper()}").content == content


@pytest.mark.parametrize(
    ("text", "content"),
    [
        (r"lamp on\r\n", b"lamp on\r\n"),
        (r"\0\t\\n", b"\0\t\\n"),
        ("\xa0\x01", b"\xa0\x01"),
        ("hexagon", b"hexagon"),
        (r"\x68ex 01", b"hex 01"),
    ],
)
def test_escapes(text: str, content: bytes) -> None:
    assert wire_text(text).content == content


@given(st.text(max_size=20) | st.text(alphabet="hex \\rn01AFg", max_size=12))
def test_any_text_is_some_bytes_or_one_line_of_refusal(text: str) -> None:
    try:
        accepted = settings({"on": text, "off": r"\xFF\x00"})
    except UsageError as error:
        assert str(error).startswith("rig.yaml, devices.lamp: on")
        assert len(str(error).splitlines()) == 1
    else:
        assert wire_text(accepted.on.send).content


STATE = {"send": "?", "on": "1", "off": "0"}


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({}, "the key 'on' is missing"),
        ({"on": "1"}, "the key 'off' is missing"),
        ({"on": 1, "off": 0}, "on: expected a command in quotes"),
        ({"on": "1", "off": "1"}, "expected different commands 'on' and 'off', got '1' for both"),
        ({"on": "hex 31", "off": "hex 3"}, "off: expected pairs of hexadecimal digits"),
        ({"on": r"lamp\q", "off": "0"}, r"on: expected \r, \n"),
        ({"on": "Ω", "off": "0"}, "on: expected characters that are one byte each, got 'Ω'"),
        ({"on": "", "off": "0"}, "on: expected at least one character"),
        ({"on": {"send": "1", "anwser": "ok"}, "off": "0"}, "did you mean 'answer'?"),
        (MINIMAL | {"state": "?"}, "state"),
        (MINIMAL | {"state": STATE | {"off": "1"}}, "expected different answers 'on' and 'off'"),
        (MINIMAL | {"state": STATE | {"off": "hex 30"}}, "both as text, or as equally many bytes"),
        (MINIMAL | {"state": STATE | {"on": 1}}, "state.on: expected text; put it in quotes"),
        (MINIMAL | {"baud": 0}, "baud"),
        (MINIMAL | {"framing": "9N1"}, "framing: expected '8N1'"),
        (MINIMAL | {"answer_end": ""}, "answer_end: expected at least one character"),
        (MINIMAL | {"starts_in": 2}, "starts_in: expected a quantity with its unit"),
        (MINIMAL | {"keep_alvie": "x"}, "did you mean 'keep_alive'?"),
    ],
)
def test_a_bad_entry_is_one_line(keys: Keys, said: str) -> None:
    with pytest.raises(UsageError) as refusal:
        settings(keys)
    assert said in str(refusal.value)
    assert len(str(refusal.value).splitlines()) == 1


@pytest.mark.parametrize("keys", [{}, {"channels": {}}, {"channels": {"": MINIMAL}},
                                  {"channels": {"a": MINIMAL, "b": MINIMAL}}])  # fmt: skip
def test_each_led_has_a_name_and_a_command_of_its_own(keys: Keys) -> None:
    with pytest.raises(UsageError):
        validate(keys, SerialLeds.Settings, "rig.yaml")
