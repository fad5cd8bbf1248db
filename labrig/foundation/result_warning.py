"""Warnings about results: what limits a number, with a stable code and the values that show it.

A warning has one of a few types by kind of limit, a code that stays the same from version to
version, the values behind it, and a sentence for people. Programs and tests compare codes and
values; terminal, report and files show the sentence, and the code that `labrig explain` takes.
"""

import math
from collections.abc import Iterable, Mapping
from copy import copy
from dataclasses import dataclass, field, is_dataclass
from string import Formatter
from typing import Any, ClassVar, Self

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, core_schema

from labrig.foundation.number_format import as_written, rounded

#: Format of a number to so many significant digits, as reports write it: `{factor:2r}`.
ROUNDED = "r"


@dataclass(frozen=True, init=False)
class ResultWarning:
    """Something that limits a result, for a person, with its values for a program.

    A package may give a plain text instead of a warning; it becomes one of this type without code.

    Parameters
    ----------
    code
        Stable name such as `rate-unresolved`; empty for a plain text.
    sentence
        What the limit is and what to do about it, with fields for the values as in `str.format`.
        Several texts are joined by commas, and `{x:3r}` is a number to three significant digits.
    subject
        Patch, sample, light or part of a chain that it is about; empty for the whole result.
    values
        Numbers with units in their names, quantities with σ, or texts, by name.

    Attributes
    ----------
    sentence
        The sentence with its values.
    values
        The values as in JSON: numbers and texts, tuples of these, and a mapping with value, sigma
        and unit of a quantity with σ.

    Examples
    --------
    >>> from labrig.foundation.result_warning import Disturbance
    >>> late = Disturbance("frames-late", "{count} frames began late, by {late_s:.2f} s", count=3,
    ...     late_s=0.125)
    >>> print(late.about("card"))
    card: 3 frames began late, by 0.12 s
    >>> late.code, late.values["late_s"]
    ('frames-late', 0.125)
    """

    kind: ClassVar[str] = "warning"

    code: str
    sentence: str
    subject: str
    values: Mapping[str, Any] = field(hash=False)

    def __init__(self, code: str, sentence: str, /, subject: str = "", **values: Any) -> None:
        object.__setattr__(self, "code", code)
        object.__setattr__(self, "sentence", _FORMATTER.vformat(sentence, (), values))
        object.__setattr__(self, "subject", subject)
        plain = {name: _plain(value) for name, value in values.items()}
        object.__setattr__(self, "values", plain)

    def about(self, subject: str) -> Self:
        """Return the warning with a subject before its own; unchanged for an empty one."""
        about = copy(self)
        object.__setattr__(about, "subject", ": ".join(filter(None, (subject, self.subject))))
        return about

    def __str__(self) -> str:
        """Return the subject and the sentence, without the code."""
        return ": ".join(filter(None, (self.subject, self.sentence)))

    def to_dict(self) -> dict[str, Any]:
        """Return type, code, subject, sentence and values for JSON; what is empty is left out."""
        content = {
            "kind": self.kind,
            "code": self.code,
            "subject": self.subject,
            "sentence": self.sentence,
            "values": dict(self.values),
        }
        return {name: value for name, value in content.items() if value or name == "sentence"}

    @staticmethod
    def of(content: Any) -> "ResultWarning":
        """Return the warning whose `to_dict` is `content`, or that of a plain text.

        Raises
        ------
        ValueError
            The content is no warning.
        """
        if isinstance(content, ResultWarning):
            return content
        if isinstance(content, str):
            content = {"sentence": content}
        if not isinstance(content, Mapping) or not isinstance(content.get("sentence"), str):
            raise ValueError("expected a warning: a text, or a mapping with a sentence")
        types: list[type[ResultWarning]] = ResultWarning.__subclasses__()
        kind = next((each for each in types if each.kind == content.get("kind")), ResultWarning)
        values = content.get("values") or {}
        return kind(
            str(content.get("code", "")),
            content["sentence"].replace("{", "{{").replace("}", "}}"),
            str(content.get("subject", "")),
            **values,
        )

    @classmethod
    def __get_pydantic_core_schema__(cls, _: Any, __: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(
            ResultWarning.of,
            serialization=core_schema.plain_serializer_function_ser_schema(ResultWarning.to_dict),
        )

    @classmethod
    def __get_pydantic_json_schema__(
        cls, _: CoreSchema, __: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        return {"type": ["object", "string"]}


class Undetermined(ResultWarning):
    """The data determine a quantity badly, or not at all."""

    kind = "undetermined"


class Misfit(ResultWarning):
    """A model does not describe the data, or another one describes them as well."""

    kind = "misfit"


class Disturbance(ResultWarning):
    """Something changed what was recorded: late or clipped frames, stray light, a drift."""

    kind = "disturbance"


class Extrapolated(ResultWarning):
    """A number reaches beyond what was measured, or beyond what an instrument can do."""

    kind = "extrapolated"


class Unmeasured(ResultWarning):
    """Something was not measured or is missing, and a number holds without it only."""

    kind = "unmeasured"


class Contradiction(ResultWarning):
    """Two statements do not agree: two measurements, a measurement and a file, or with physics."""

    kind = "contradiction"


class _Values(Formatter):
    """Formatter of the values in a sentence."""

    def format_field(self, value: Any, format_spec: str) -> str:
        if isinstance(value, tuple | list):
            return ", ".join(self.format_field(each, format_spec) for each in value)
        if format_spec.endswith(ROUNDED):
            digits = int(format_spec.removesuffix(ROUNDED))
            return "∞" if value == math.inf else rounded(float(value), digits)
        text = str(super().format_field(value, format_spec))
        return text if isinstance(value, str) or not format_spec else as_written(text)


_FORMATTER = _Values()


def _plain(value: Any) -> Any:
    """Return a value as JSON has it: a quantity by value, σ and unit; no number is infinite."""
    if is_dataclass(value):
        value = vars(value)
    if isinstance(value, Mapping):
        return {name: _plain(each) for name, each in value.items()}
    if isinstance(value, tuple | list):
        return tuple(_plain(each) for each in value)
    if isinstance(value, str | bool) or value is None:
        return value
    number = value if isinstance(value, int) else float(value)
    return number if math.isfinite(number) else str(number)


def as_warnings(warnings: Iterable[ResultWarning | str]) -> tuple[ResultWarning, ...]:
    """Return warnings, those that are plain texts as warnings without a code."""
    return tuple(ResultWarning.of(each) for each in warnings)


def warning_lines(warnings: Iterable[ResultWarning], mark: str = "! ") -> list[str]:
    """Return warnings as lines for the terminal and text files, with their codes."""
    return [f"{mark}{each}{f' [{each.code}]' if each.code else ''}" for each in warnings]
