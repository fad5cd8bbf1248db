"""Quantities with units in files: `90 min`, `1/60 s`, `0.7 %`, `25 MB`, `0.4 mm`, `300 g/m2`.

Each annotated type below turns such a text into a plain float in the named unit, so that inside
labrig a name such as `exposure_s` carries the unit.
"""

import math
import re
from collections.abc import Callable
from typing import Annotated, Any

from pydantic import (
    BeforeValidator,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    PlainSerializer,
    WithJsonSchema,
)
from pydantic_core import core_schema

TIME_S = {"us": 1e-6, "µs": 1e-6, "ms": 1e-3, "s": 1.0, "min": 60.0, "h": 3600.0}
FRACTION = {"%": 0.01}
TEMPERATURE_STEP_K = {"K": 1.0}
#: Boltzmann's constant in eV/K, exact since 2019, and 0 °C in K.
BOLTZMANN_EV_PER_K = 8.617333262e-5
ZERO_C_K = 273.15
LENGTH_MM = {"um": 1e-3, "µm": 1e-3, "mm": 1.0, "cm": 10.0}
MASS_PER_AREA_G_PER_M2 = {"g/m2": 1.0, "g/m²": 1.0, "mg/cm2": 10.0, "mg/cm²": 10.0}
SIZE_BYTES = {"B": 1.0, "kB": 1e3, "MB": 1e6, "GB": 1e9}

#: Characters that look like those of the units above, or like a blank; a reader cannot tell them.
_LOOKALIKES = str.maketrans(
    {"\u03bc": "µ", **dict.fromkeys("\u00a0\u2007\u2009\u202f\u3000", " "), "\uff05": "%"}
)
_PATTERN = re.compile(
    r"\s*(?P<number>\d+(?:\.\d*)?(?:[eE][-+]?\d+)?|\.\d+)(?:\s*/\s*(?P<divisor>\d+(?:\.\d+)?))?"
    r"\s*(?P<unit>[A-Za-zµ%]+(?:/[a-z]+[2²])?)\s*"
)
_ALL_UNITS = (
    TIME_S, FRACTION, TEMPERATURE_STEP_K, LENGTH_MM, MASS_PER_AREA_G_PER_M2, SIZE_BYTES,
)  # fmt: skip
#: Example of a quantity in a refusal.
_SUCH_AS = re.compile(r"(unit(?: \([^)]*\))?,? such as )'[^']*'")


def parse(text: str, units: dict[str, float]) -> float:
    """Return the value of `text` in the base unit of `units`.

    Raises
    ------
    ValueError
        The text is not a number with one of the units, or it is negative or not finite.
    """
    match = _PATTERN.fullmatch(text.translate(_LOOKALIKES))
    if match is None or match["unit"] not in units:
        example = next(unit for unit, factor in units.items() if factor == max(units.values()))
        with_point = text.replace(",", ".", 1)
        is_comma = with_point != text and _PATTERN.fullmatch(with_point) is not None
        remedy = f"; write a decimal point: '{with_point}'" if is_comma else ""
        raise ValueError(
            f"expected a number with a unit ({', '.join(units)}), such as '5 {example}', "
            f"got '{text}'{remedy}"
        )
    divisor = float(match["divisor"] or 1)
    value = float(match["number"]) / divisor * units[match["unit"]] if divisor else math.inf
    if not math.isfinite(value):
        raise ValueError(f"expected a finite quantity, got '{text}'")
    return value


def unit_of(example: str) -> tuple[str, float]:
    """Return the unit of a quantity as text, and its size in the unit within labrig.

    Parameters
    ----------
    example
        Text of a quantity, such as `1000 us`.

    Returns
    -------
    tuple of str and float
        Unit and size, such as `("us", 1e-6)`; `("", 1.0)` if the text is no quantity.

    Examples
    --------
    >>> from labrig.foundation.quantity import unit_of
    >>> unit_of("1000 us"), unit_of("decay")
    (('us', 1e-06), ('', 1.0))
    """
    match = _PATTERN.fullmatch(example.translate(_LOOKALIKES))
    for units in _ALL_UNITS:
        if match is not None and match["unit"] in units:
            return match["unit"], units[match["unit"]]
    return "", 1.0


def in_unit_of(example: str, refusal: str, received: Any) -> str:
    """Return the refusal of a quantity with an example in the unit of its key.

    Parameters
    ----------
    example
        Text of a quantity that the key may have, such as `1000 us`; empty if there is none.
    refusal
        Refusal with another example, or of another kind, which stays as it is.
    received
        Value that was refused; a plain number is the example's.

    Examples
    --------
    >>> from labrig.foundation.quantity import in_unit_of
    >>> in_unit_of("300 ms", "expected a quantity with its unit, such as '60 s'", 60)
    "expected a quantity with its unit, such as '60 ms'"
    """
    unit, _ = unit_of(example)
    if not unit:
        return refusal
    is_number = re.fullmatch(r"\s*\d+(\.\d+)?\s*", str(received)) is not None
    shown = f"{str(received).strip()} {unit}" if is_number else example
    if unit in FRACTION and is_number and not _SUCH_AS.search(refusal):
        return f"{refusal}, such as '{shown}'"
    return _SUCH_AS.sub(lambda match: f"{match[1]}'{shown}'", refusal)


def duration_text(seconds: float) -> str:
    """Format a duration, such as `1 h 30 min`, `5 s`, `320 ms`."""
    if seconds >= 3600:
        minutes = round(seconds / 60)
        return f"{minutes // 60} h" + (f" {minutes % 60} min" if minutes % 60 else "")
    if seconds >= 60:
        total_s = round(seconds)
        return f"{total_s // 60} min" + (f" {total_s % 60} s" if total_s % 60 else "")
    if seconds >= 1:
        return f"{seconds:.4g} s"
    return f"{seconds * 1e3:.4g} ms"


def _read(units: dict[str, float], bare: bool) -> Callable[[Any], Any]:
    def validate(value: Any) -> Any:
        if isinstance(value, str):
            return parse(value, units)
        if isinstance(value, (int, float)) and not isinstance(value, bool) and not bare:
            unit = next(iter(units)) if len(units) == 1 else next(u for u in units if units[u] == 1)
            raise ValueError(f"expected a quantity with its unit, such as '{value} {unit}'")
        return value

    return validate


def _validator(units: dict[str, float], bare: bool) -> BeforeValidator:
    return BeforeValidator(_read(units, bare))


_DURATION = _read(TIME_S, bare=False)


def _time(value: Any) -> Any:
    """Return a time of a clock, which may be before its zero."""
    text = value.strip() if isinstance(value, str) else ""
    if text[:1] in ("-", "−", "\u2013") and text:
        return -parse(text[1:], TIME_S)
    return _DURATION(value)


def _serializer(unit: str) -> PlainSerializer:
    return PlainSerializer(lambda value: _written(value, unit), return_type=str)


def _written(value: float, unit: str) -> str:
    """Return a text that is read as the same number, such as `300 s`."""
    return f"{repr(value).removesuffix('.0')} {unit}"


def _schema(units: dict[str, float], bare: bool, sign: str = "") -> WithJsonSchema:
    """Return the JSON Schema of the accepted texts, for editors."""
    unit_pattern = "|".join(sorted(units, key=len, reverse=True)).replace("µ", "[µ\u03bc]")
    number_pattern = r"(\d+(\.\d*)?([eE][-+]?\d+)?|\.\d+)(\s*/\s*\d+(\.\d+)?)?"
    text = {
        "type": "string",
        "pattern": rf"^\s*{sign}{number_pattern}\s*({unit_pattern})\s*$",
        "description": f"a number with its unit: {', '.join(units)}",
    }
    return WithJsonSchema({"anyOf": [text, {"type": "number"}]} if bare else text, "validation")


class WordOrDuration:
    """Annotation: one of `words`, or a duration in seconds written with its unit."""

    def __init__(self, *words: str) -> None:
        self._words = words

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        return core_schema.no_info_before_validator_function(
            self._validate,
            handler(source),
            serialization=core_schema.plain_serializer_function_ser_schema(
                lambda value: value if isinstance(value, str) else _written(value, "s")
            ),
        )

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        duration = _schema(TIME_S, bare=False).json_schema
        return {"anyOf": [{"enum": list(self._words)}, duration]}

    def _validate(self, value: Any) -> Any:
        expected = " or ".join(self._words)
        if not isinstance(value, str):
            raise ValueError(
                f"expected {expected}, or a duration with its unit such as '5 s', got '{value}'"
            )
        if value in self._words:
            return value
        try:
            return parse(value, TIME_S)
        except ValueError as error:
            raise ValueError(f"expected {expected}, or a duration; {error}") from None


#: Largest number of repetitions in a protocol.
MAX_COUNT = 1000
Count = Annotated[int, Field(le=MAX_COUNT)]
#: Seconds, written with a unit of time.
DurationS = Annotated[
    float, _validator(TIME_S, bare=False), _serializer("s"), _schema(TIME_S, bare=False)
]
#: Seconds of a clock, written with a unit of time; before its zero with a minus.
TimeS = Annotated[
    float, BeforeValidator(_time), _serializer("s"), _schema(TIME_S, bare=False, sign="[-−\u2013]?")
]
#: A fraction, written as `0.7 %` or as a bare 0.007.
Fraction = Annotated[float, _validator(FRACTION, bare=True), _schema(FRACTION, bare=True)]
#: Millimetres, written with a unit of length.
LengthMm = Annotated[
    float, _validator(LENGTH_MM, bare=False), _serializer("mm"), _schema(LENGTH_MM, bare=False)
]
#: Grams per square metre, written with a unit such as `g/m2`.
MassPerArea = Annotated[
    float,
    _validator(MASS_PER_AREA_G_PER_M2, bare=False),
    _serializer("g/m2"),
    _schema(MASS_PER_AREA_G_PER_M2, bare=False),
]
#: Bytes, written with a unit such as `MB`.
SizeBytes = Annotated[
    float, _validator(SIZE_BYTES, bare=False), _serializer("B"), _schema(SIZE_BYTES, bare=False)
]
