"""Warnings about results: sentence, values, JSON, and plain texts of packages."""

import json
import math

import pytest
from hypothesis import given, strategies as st

from labrig.foundation.result_warning import (
    Disturbance,
    ResultWarning,
    Undetermined,
    as_warnings,
    warning_lines,
)
from labrig.results import Measured

RATE = Undetermined(
    "rate-unresolved",
    "{names} of {rate} {{1/s}} differ by {factor:2r}",
    names=("k1", "k2"),
    rate=Measured(0.0802, 0.0013, "1/s"),
    factor=12345.0,
    limit=math.inf,
)


def test_a_sentence_has_its_values_as_people_write_them() -> None:
    assert str(RATE) == "k1, k2 of 0.0802(13) 1/s {1/s} differ by 12000"
    assert str(RATE.about("red").about("excitation")) == f"excitation: red: {RATE.sentence}"
    assert RATE.about("") == RATE
    assert warning_lines([RATE, ResultWarning("", "plain")]) == [
        f"! {RATE} [rate-unresolved]",
        "! plain",
    ]


def test_a_warning_is_read_back_from_json() -> None:
    about = RATE.about("red")
    content = about.to_dict()
    again = ResultWarning.of(json.loads(json.dumps(content)))
    assert (type(again), again, again.to_dict()) == (Undetermined, about, content)
    assert content["values"]["rate"] == {"value": 0.0802, "sigma": 0.0013, "unit": "1/s"}
    assert content["values"]["limit"] == "inf"


def test_a_plain_text_is_a_warning_without_a_code() -> None:
    (plain, own) = as_warnings(["lens {dirty}", RATE])
    assert (str(plain), plain.code, own) == ("lens {dirty}", "", RATE)
    assert plain.to_dict() == {"kind": "warning", "sentence": "lens {dirty}"}


@pytest.mark.parametrize("content", [None, 3, {}, {"sentence": 1}, ["a"]])
def test_what_is_no_warning_is_refused(content: object) -> None:
    with pytest.raises(ValueError, match="expected a warning"):
        ResultWarning.of(content)


@given(st.text(), st.text(), st.floats() | st.text() | st.integers())
def test_any_text_and_value_survives(sentence: str, subject: str, value: float | str) -> None:
    escaped = sentence.replace("{", "{{").replace("}", "}}")
    warning = Disturbance("code", escaped, subject, value=value)
    assert warning.sentence == sentence
    assert ResultWarning.of(json.loads(json.dumps(warning.to_dict()))) == warning


@pytest.mark.parametrize(
    ("form", "value", "text"),
    [
        ("{x:.0%}", 0.123, "12 %"),
        ("{x:+.1f}", -1.25, "−1.2"),
        ("{x:.1g}", 3.2e-7, "3 × 10⁻⁷"),
        ("{x:.3g}", 1.5e12, "1.5 × 10¹²"),
        ("{x}", "re-read", "re-read"),
        ("{x:>4}", "e-5", " e-5"),
        ("{x:.2f}", (0.5, -2), "0.50, −2.00"),
    ],
)
def test_numbers_are_written_as_people_do(form: str, value: object, text: str) -> None:
    assert Disturbance("code", form, x=value).sentence == text
