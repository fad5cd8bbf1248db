"""Reductions of the frames of a run, kept in the run folder for the next time.

Each reduction, with its arguments, has a file of its own in the folder `cache`. A file that is
damaged, or that another user or another PC wrote, counts as missing; all of them may be deleted
without loss. Files that other code made, such as an older labrig, are deleted when the reduction is
kept anew.

A value is a number, a text, None, an array of numbers, or a tuple, mapping, frozen dataclass or
model of such. Text, unlike a pickle, cannot run anything when it is read.
"""

import json
from base64 import b64decode, b64encode
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import fields, is_dataclass
from functools import cache
from hashlib import sha256
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, TypeAdapter

from labrig.foundation.clock import SystemClock
from labrig.foundation.errors import DiskError, LabrigError
from labrig.foundation.input_file import read_bytes, read_text
from labrig.foundation.output_file import make_folder_in, write_text
from labrig.record import CACHE, own_digest

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


#: Time in seconds after which what is new is written, so that little is lost if the process is
#: killed.
_WRITE_EVERY_S = 10.0
_CLOCK = SystemClock()
#: Largest file of them that is read, of some 10,000 frames of many patches.
MAX_CACHE_BYTES = 200_000_000
#: Libraries whose version changes what is reduced from a frame.
_LIBRARIES = ("labrig", "numpy", "scipy", "rawpy")
#: Modules beside those of `labrig.reduce` whose code reduces frames.
_MODULES = (
    "labrig.foundation.nonnegative",
    "labrig.foundation.region",
    "labrig.optics.camera_model",
)


class ReductionCache:
    """Outcomes of one reduction for the frames of one run.

    Parameters
    ----------
    run
        Run folder.
    reduction
        The reduction with its arguments.
    """

    def __init__(self, run: Path, reduction: Any) -> None:
        kind = type(reduction)
        name, code = f"{kind.__module__}.{kind.__qualname__}", _code_checksum(kind.__module__)
        arguments = _checksum(f"{name} {encoded(reduction)}")
        self._name, self._ending = kind.__qualname__, f"{code[:16]}.jsonl"
        self._path = run / CACHE / f"{self._name}-{arguments[:16]}-{self._ending}"
        self._identity = f"{arguments} {code}"
        self._texts = self._read()
        self._is_changed, self._written_s = False, _CLOCK.now()

    def get(self, key: str) -> str | None:
        """Return what was kept under a key; None if nothing was."""
        return self._texts.get(key)

    def add(self, key: str, text: str) -> None:
        """Keep a line of text under a key."""
        self._texts[key] = text
        self._is_changed = True
        if _CLOCK.now() - self._written_s >= _WRITE_EVERY_S:
            self.write()

    def write(self) -> None:
        """Write what is new, as far as the disk allows: nothing depends on it."""
        if not self._is_changed:
            return
        content = "".join(f"{key} {text}\n" for key, text in self._texts.items())
        head = f"{self._identity} {own_digest(content.encode())}\n"
        with suppress(OSError, DiskError):
            make_folder_in(self._path.parents[1], CACHE)
            write_text(self._path, head + content)
            for path in self._path.parent.glob(f"{self._name}-*.jsonl"):
                if not path.name.endswith(self._ending):
                    path.unlink()
        self._is_changed, self._written_s = False, _CLOCK.now()

    def _read(self) -> dict[str, str]:
        """Return the texts by key; none if the file is missing or damaged."""
        try:
            head, _, content = read_text(self._path, MAX_CACHE_BYTES).partition("\n")
        except LabrigError:
            return {}
        if head != f"{self._identity} {own_digest(content.encode())}":
            return {}
        pairs = (line.partition(" ") for line in content.splitlines())
        return {key: text for key, _, text in pairs}


def _checksum(text: str) -> str:
    return sha256(text.encode()).hexdigest()


@cache
def _code_checksum(module: str) -> str:
    """Return the checksum of all code that turns a frame into what `module` makes of it."""
    import cv2

    digest = sha256(json.dumps([*map(version, _LIBRARIES), cv2.__version__]).encode())
    folder = Path(__file__).parent
    others = [Path(str(import_module(name).__file__)) for name in (*_MODULES, module)]
    for path in (*sorted(folder.glob("*.py")), *others):
        digest.update(read_bytes(path, MAX_CACHE_BYTES))
    return digest.hexdigest()
