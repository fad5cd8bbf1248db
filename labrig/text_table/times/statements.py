"""What the lines above a table say of its times: their unit, the width of a channel.

Programs that count photons write the width of a channel as `Time calibration = 4.0E-10 sec/ch`,
as `Resolution: 32 ps`, or as `#ns/channel` above a line with one number for each curve.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

from labrig.foundation.errors import UsageError
from labrig.text_table.names import split_time, split_unit, time_unit_s
from labrig.text_table.style import Line

_WORD = r"[a-zµμ]+"
_NUMBER = r"[+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][+-]?\d+)?"
_PER_SECOND = r"[kmg]?(?:hz|s/s|sa/s|samples?/s(?:ec)?|sps)\b|fps\b|frames/s|1/s|s\^?-1"
_CHANNEL = r"(?:channels?|chan|chs?|bins?|points?|pts?|samples?|rows?|steps?|kanal|canal|canaux)\b"
_PER = r"\s*(?:/|\b(?:per|pro|par|each)\b)\s*"
#: `4.0E-10 sec/ch`, `0.4 ns per channel`.
_NUMBER_PER_CHANNEL = re.compile(
    rf"(?P<number>{_NUMBER})\s*(?P<unit>{_WORD}){_PER}{_CHANNEL}", re.IGNORECASE
)
#: `ns/channel: 0.4`, or with the numbers in the line below.
_UNIT_PER_CHANNEL = re.compile(
    rf"(?<![a-zµμ])(?P<unit>{_WORD}){_PER}{_CHANNEL}(?P<rest>.*)", re.IGNORECASE
)
#: `Resolution: 32 ps`, `Channel width (ns)	0.4`, `time_per_bin_ps = 16`.
_WIDTH = re.compile(
    rf"""(?<![a-z])(?:(?:time[\s_-]*)?(?:channel|chan|bin)[\s_-]*(?:width|size|length|duration|time)
    |(?:time|zeit|temps)[\s_-]*(?:/|per|pro|par)?[\s_-]*(?:channel|chan|kanal|canal|ch|bin|point|pt|sample)
    |kanalbreite
    |(?:time[\s_-]*)?resolution|time[\s_-]*(?:calibration|increment|interval|step)|tcal
    |dwell(?:[\s_-]*time)?|sampl(?:e|ing)[\s_-]*(?:interval|period|time)
    |x[\s_-]*inc(?:r(?:ement)?)?|delta[\s_-]*[xt]|[dΔ]t)
    (?:[\s_]*[(\[]?(?P<before>{_WORD})[)\]]?)?\s*["']?[\s:=,;|]*["']?
    (?P<number>{_NUMBER})\s*[,;"']?\s*(?:[(\[]?(?P<after>{_WORD})\b)?""",
    re.IGNORECASE | re.VERBOSE,
)
#: `Sample rate: 2500 Hz`, `Sampling frequency (kHz) = 2.5`, `Frame rate 25 fps`.
_RATE = re.compile(
    rf"""(?<![a-z])(?:(?:sampl\w*|acquisition|scan|frame|data|abtast|bild)[\s_-]*(?:rate|frequency|frequenz|freq)
    |abtastrate|abtastfrequenz|bildrate)
    (?:[\s_]*[(\[]?(?P<before>{_PER_SECOND})[)\]]?)?\s*["']?[\s:=,;|]*["']?
    (?P<number>{_NUMBER})\s*[,;"']?\s*(?:[(\[]?(?P<after>{_PER_SECOND}))?""",
    re.IGNORECASE | re.VERBOSE,
)
_PREFIXES = {"": 1.0, "k": 1e3, "M": 1e6, "G": 1e9}
#: `Time unit: ns`, `X-axis (ns)`, `Xaxis,Time(ns)`, `Units = ns`.
_AXIS_UNIT = re.compile(
    r"""[\#\s"'*]*(?:(?:x|t|time|horizontal|abscissa|zeit|temps)[\s_-]*)?
    (?:axis|scale|base|units?|labels?|title|dimension|einheit|achse)
    (?:[\s_-]*(?:units?|labels?|title|of[\s_-]*(?:time|x)))*["']?
    \s*[\t,;:=|\s(\[]\s*(?P<value>.+)""",
    re.IGNORECASE | re.VERBOSE,
)
#: `all times in ns`, `column 1: time (ns)`, without a number that would make it another time.
_IN_UNIT = re.compile(
    rf"[^\d]*(?:\d+\s*:)?[^\d]*\b(?:times?|zeit(?:en)?|temps)\b[^\d]*?"
    rf"(?:\bin\s+|[(\[]\s*)(?P<unit>{_WORD})\b[^\d]*",
    re.IGNORECASE,
)
_OTHER_TIMES = re.compile(
    r"integration|exposure|acqui|collect|delay|dwell|dead|gate|live|real|measure|rise|response|"
    r"lifetime|per\b",
    re.IGNORECASE,
)
#: Words of a line about the axis of times, and of one about other times of a measurement.
_OF_AXIS = re.compile(
    r"(?:time|tac|x|sweep|record|channel|bin|sampl\w*|horizontal)[\s_-]*(?:range|window|span|scale|"
    r"base|axis|step|resolution|calibration|width|increment|interval|/\s*div)|resolution|"
    r"zeitbereich",
    re.IGNORECASE,
)
_TIME = re.compile(rf"(?P<number>{_NUMBER})\s*(?P<unit>{_WORD})\b", re.IGNORECASE)
_THOUSAND = re.compile(r"[1-9]\d{0,2},\d{3}")


@dataclass(frozen=True)
class ChannelWidth:
    """Width of a channel, for each curve or one for all, and what says so."""

    widths_s: tuple[float, ...]
    unit: str
    line: Line | None

    @property
    def numbers(self) -> tuple[str, ...]:
        """Names of columns that have none: their numbers, from 1."""
        return tuple(str(number) for number in range(1, len(self.widths_s) + 1))

    def __str__(self) -> str:
        """Return what says so."""
        return "--time-per-channel" if self.line is None else quoted(self.line)


def quoted(line: Line) -> str:
    """Return a line in quotation marks, with its number, as messages show it."""
    text = " ".join(line.text.split())
    return f"line {line.number} '{text if len(text) <= 40 else text[:39] + '…'}'"


def parse_width(text: str) -> ChannelWidth | None:
    """Return the width of a channel in a text such as `0.4 ns`; None if it is none."""
    match = _TIME.fullmatch(text.strip())
    unit_s = time_unit_s(match["unit"]) if match else None
    if match is None or unit_s is None or _THOUSAND.fullmatch(match["number"]):
        return None
    width_s = float(match["number"].replace(",", ".")) * unit_s
    return ChannelWidth((width_s,), match["unit"], None) if 0 < width_s < math.inf else None


def channel_width(above: Sequence[Line]) -> ChannelWidth | None:
    """Return the width of a channel that the lines above a table state.

    Raises
    ------
    UsageError
        Two lines contradict each other.
    """
    found: list[ChannelWidth] = []
    stated = axis_unit(above)
    for index, line in enumerate(above):
        below = above[index + 1] if index + 1 < len(above) else None
        if width := _width_in(line, below, stated):
            found.append(width)
    for other in found[1:]:
        if other.widths_s != found[0].widths_s[: len(other.widths_s)] and not _are_alike(
            found[0].widths_s[0], other.widths_s[0]
        ):
            raise UsageError(
                f"expected one width of a channel, got {found[0]} and {other}; "
                "say which with '--time-per-channel'"
            )
    return found[0] if found else None


def _are_alike(a: float, b: float) -> bool:
    return abs(a - b) <= 1e-3 * max(abs(a), abs(b))


def _width_in(
    line: Line, below: Line | None, stated: tuple[str, Line] | None
) -> ChannelWidth | None:
    """Return the width that a line states, or that it names and the line below states.

    One without a unit, such as `XINCR 4E-10`, is in that which another line states for the axis.
    """
    text = line.text
    for match in _NUMBER_PER_CHANNEL.finditer(text):
        unit_s = time_unit_s(match["unit"])
        if unit_s is not None:
            return _checked((_number(match["number"], line) * unit_s,), match["unit"], line)
    for match in _UNIT_PER_CHANNEL.finditer(text):
        unit_s = time_unit_s(match["unit"])
        if unit_s is None:
            continue
        rest = match["rest"] if re.search(r"\d", match["rest"]) else below.text if below else ""
        cells = [cell for cell in re.split(r"[\s;|:=)\]]+", rest) if cell]
        numbers = [cell.strip(",") for cell in cells if re.fullmatch(_NUMBER, cell.strip(","))]
        if numbers:
            widths_s = tuple(_number(cell, line) * unit_s for cell in numbers)
            return _checked(widths_s, match["unit"], line)
    for match in _WIDTH.finditer(text):
        unit = match["before"] or match["after"] or (stated[0] if stated else "")
        unit_s = time_unit_s(unit)
        if unit and unit_s is not None:
            return _checked((_number(match["number"], line) * unit_s,), unit, line)
    for match in _RATE.finditer(text):
        unit = match["before"] or match["after"] or ""
        rate = _number(match["number"], line)
        prefix = unit[:1] if re.match(r"[kKMG](?:hz|s)", unit, re.IGNORECASE) else ""
        if unit and rate > 0 and not re.match(r"m(?:hz|s)", unit):
            return _checked((1 / (rate * _PREFIXES[prefix.upper().replace("K", "k")]),), "s", line)
    return None


def _checked(widths_s: tuple[float, ...], unit: str, line: Line) -> ChannelWidth:
    # Curves of no counts have a width of 0.
    if not any(width > 0 for width in widths_s):
        raise UsageError(
            f"expected a width of a channel above 0, got {quoted(line)}; say '--time-per-channel'"
        )
    return ChannelWidth(widths_s, unit, line)


def _number(text: str, line: Line) -> float:
    if _THOUSAND.fullmatch(text):
        raise UsageError(
            f"expected a number that can be read in one way, got '{text}' in {quoted(line)}; "
            "say '--time-per-channel'"
        )
    return float(text.replace(",", "."))


def axis_unit(above: Sequence[Line]) -> tuple[str, Line] | None:
    """Return the unit of time that a line about the axis states, and the line.

    Raises
    ------
    UsageError
        Two lines contradict each other.
    """
    found: list[tuple[str, Line]] = []
    for line in above:
        match = _AXIS_UNIT.match(line.text)
        for value in re.split(r"[\t,;|]", match["value"]) if match else ():
            text = value.strip(" \t\"'")
            unit = text if time_unit_s(text) else (split_time(text) or split_unit(text))[1]
            if unit and time_unit_s(unit) is not None:
                found.append((unit, line))
        spoken = None if match or _OTHER_TIMES.search(line.text) else _IN_UNIT.fullmatch(line.text)
        if spoken and time_unit_s(spoken["unit"]) is not None:
            found.append((spoken["unit"], line))
    for unit, line in found[1:]:
        if time_unit_s(unit) != time_unit_s(found[0][0]):
            raise UsageError(
                f"expected one unit of the times, got {quoted(found[0][1])} and {quoted(line)}; "
                "say which with '--time-unit'"
            )
    return found[0] if found else None


def axis_times_s(above: Sequence[Line]) -> list[tuple[float, str, Line]]:
    """Return the times in lines about range, step or resolution of the axis, and their units."""
    found = []
    for line in above:
        if not _OF_AXIS.search(line.text):
            continue
        for match in _TIME.finditer(line.text):
            unit_s = time_unit_s(match["unit"])
            if unit_s is not None and not _THOUSAND.fullmatch(match["number"]):
                number = float(match["number"].replace(",", "."))
                found.append((number * unit_s, match["unit"], line))
    return found
