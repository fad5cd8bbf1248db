"""A result is the same once it is written and read back."""

import json
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from labrig.results import RunResult


def assert_read_back(result: RunResult) -> None:
    """From `result.json` comes the same type with the same numbers."""
    again = type(result).from_dict(json.loads(result.to_json()))
    _assert_same(result, again, type(result).__name__)


def _assert_same(one: Any, other: Any, name: str) -> None:
    assert type(one) is type(other), name
    if isinstance(one, np.ndarray):
        assert one.dtype == other.dtype, name
        np.testing.assert_array_equal(one, other, err_msg=name)
    elif is_dataclass(one):
        for field in fields(one):
            of_one, of_other = getattr(one, field.name), getattr(other, field.name)
            _assert_same(of_one, of_other, f"{name}.{field.name}")
    elif isinstance(one, dict):
        assert list(one) == list(other), name
        for key, value in one.items():
            _assert_same(value, other[key], f"{name}[{key!r}]")
    elif isinstance(one, tuple):
        assert len(one) == len(other), name
        for number, (of_one, of_other) in enumerate(zip(one, other, strict=True)):
            _assert_same(of_one, of_other, f"{name}[{number}]")
    else:
        assert one == other or (one != one and other != other), name
