"""Refusals of pydantic's models in plain words: at which keys of a file, and what was expected."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

from pydantic_core import ErrorDetails

#: Keys and numbers in lists that lead to a value in a file.
Location = tuple[int | str, ...]

#: What is expected instead, by the type of pydantic's error; `{…}` is from the error's context.
_EXPECTED = {
    "bool_parsing": "true or false",
    "bool_type": "true or false",
    "datetime_from_date_parsing": "a date and time, such as 2026-11-21T09:14:03Z",
    "datetime_parsing": "a date and time, such as 2026-11-21T09:14:03Z",
    "datetime_type": "a date and time, such as 2026-11-21T09:14:03Z",
    "decimal_parsing": "a number",
    "decimal_type": "a number",
    "dict_type": "'key: value' lines",
    "enum": "{expected}",
    "finite_number": "a finite number",
    "float_parsing": "a number",
    "float_type": "a number",
    "frozen_set_type": "a list",
    "greater_than": "a number greater than {gt}",
    "greater_than_equal": "a number of at least {ge}",
    "int_from_float": "a whole number",
    "int_parsing": "a whole number",
    "int_parsing_size": "a smaller whole number",
    "int_type": "a whole number",
    "invalid_key": "a word as key",
    "iterable_type": "a list",
    "less_than": "a number less than {lt}",
    "less_than_equal": "a number of at most {le}",
    "list_type": "a list",
    "literal_error": "{expected}",
    "mapping_type": "'key: value' lines",
    "model_attributes_type": "'key: value' lines",
    "model_type": "'key: value' lines",
    "multiple_of": "a multiple of {multiple_of}",
    "none_required": "nothing",
    "set_type": "a list",
    "string_pattern_mismatch": "text of the form {pattern}",
    "string_too_long": "text of at most {max_length} characters",
    "string_too_short": "text of at least {min_length} characters",
    "string_type": "text",
    "string_unicode": "text",
    "timezone_aware": "a date and time with its timezone, such as 2026-11-21T09:14:03Z",
    "too_long": "at most {max_length} values, got {actual_length}",
    "too_short": "at least {min_length} values, got {actual_length}",
    "tuple_type": "a list",
    "union_tag_invalid": "{discriminator}: one of {expected_tags}",
    "union_tag_not_found": "the key {discriminator}",
}
_RULES = ("value_error", "assertion_error")
#: Counts of one, whose noun stands in the singular.
_COUNT_OF_ONE = re.compile(r"\b(at (?:least|most) 1 (?:value|character))s")


def is_rule(problem: ErrorDetails) -> bool:
    """Return whether a rule of labrig refused the value, in words of its own."""
    return problem["type"] in _RULES


def refusal(
    problem: ErrorDetails, alike: Sequence[ErrorDetails], unit: tuple[str, float] = ("", 1.0)
) -> str:
    """Return what was expected at a place of a file.

    Parameters
    ----------
    problem
        Error of pydantic.
    alike
        Errors at the same place, this one included: those of the other types of a union.
    unit
        Unit in which the file has the value, and its size in that of the model.

    Returns
    -------
    str
        Text such as `expected a number`, or the sentence of a rule of labrig.
    """
    if is_rule(problem):
        return problem["msg"].removeprefix("Value error, ").removeprefix("Assertion failed, ")
    lacking = [int(each["loc"][-1]) for each in alike if lacks_item(each)]
    if lacking:
        return f"expected {max(lacking) + 1} values, got {min(lacking)}"
    expected = dict.fromkeys(_expected(each, unit) for each in alike if not is_rule(each))
    return f"expected {' or '.join(expected)}"


def place(problem: ErrorDetails, content: Mapping[Any, Any]) -> Location:
    """Return where a refused value is in a file.

    pydantic's own location also names the types that it tried, which stand in no file.

    Parameters
    ----------
    problem
        Error of pydantic.
    content
        Content of the file.
    """
    location: list[int | str] = []
    value: Any = content
    parts = problem["loc"][:-1] if lacks_item(problem) else problem["loc"]
    is_of_a_key = problem["type"] in ("missing", "extra_forbidden")
    for number, part in enumerate(parts):
        is_last = number == len(parts) - 1
        if isinstance(value, Mapping):
            by_text = {str(key): inner for key, inner in value.items()}
            if str(part) in by_text:
                value = by_text[str(part)]
                location.append(part)
                continue
        elif isinstance(value, Sequence) and isinstance(part, int) and part < len(value):
            value = value[part]
            location.append(part)
            continue
        if is_last and is_of_a_key:
            location.append(part)
    return tuple(location)


def lacks_item(problem: ErrorDetails) -> bool:
    """Return whether a list is too short for what it stands for."""
    return problem["type"] == "missing" and isinstance(problem["loc"][-1], int)


def _expected(problem: ErrorDetails, unit: tuple[str, float]) -> str:
    name, size = unit
    context = {
        key: (f"{value / size:g} {name}".rstrip() if value else "0")
        if isinstance(value, float)
        else value
        for key, value in problem.get("ctx", {}).items()
    }
    text = _EXPECTED.get(problem["type"], "another value").format_map(context)
    return _COUNT_OF_ONE.sub(r"\1", text)
