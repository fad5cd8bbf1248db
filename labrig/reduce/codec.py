"""Values reduced from frames as text, and back without the loss of a bit.

A value is a number, a text, None, an array of numbers, or a tuple, mapping, frozen dataclass or
model of such. Text, unlike a pickle, cannot run anything when it is read.
"""

import json
from base64 import b64decode, b64encode
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, TypeAdapter

#: Keys of an array.
_ARRAY = {"dtype", "shape", "base64"}
#: Kinds of numbers in arrays: bool, signed and unsigned integer, float.
_NUMBERS = "biuf"


def encoded(value: Any) -> str:
    """Return a value as text in one line; equal values have equal texts."""
    return json.dumps(_plain(value), separators=(",", ":"))


def decoded(text: str, kind: Any) -> Any:
    """Return the value of a type whose `encoded` is the text.

    Raises
    ------
    ValueError
        The text is not that of such a value.
    """
    try:
        content = json.loads(text, object_hook=_array_or_object)
        (value,) = _adapter(kind).validate_python((content,))
    except (TypeError, RecursionError, OverflowError) as error:
        raise ValueError(f"not the text of a value ({error})") from None
    return value


@cache
def _adapter(kind: Any) -> TypeAdapter[Any]:
    """Return what validates a tuple of one value: a dataclass by itself would take no settings."""
    return TypeAdapter(tuple[kind], config=ConfigDict(arbitrary_types_allowed=True))


def _plain(value: Any) -> Any:
    """Return a value in JSON's own types."""
    if isinstance(value, np.ndarray):
        content = b64encode(value.tobytes()).decode("ascii")
        return {"dtype": value.dtype.str, "shape": list(value.shape), "base64": content}
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, BaseModel):
        return _plain(value.model_dump())
    if is_dataclass(value):
        return {field.name: _plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return value


def _array_or_object(content: dict[str, Any]) -> Any:
    if content.keys() != _ARRAY:
        return content
    dtype = np.dtype(content["dtype"])
    if dtype.kind not in _NUMBERS:
        raise ValueError(f"expected an array of numbers, got one of {dtype}")
    array = np.frombuffer(b64decode(content["base64"], validate=True), dtype)
    return array.reshape(content["shape"]).copy()
