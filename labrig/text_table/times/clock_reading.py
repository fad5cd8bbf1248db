"""One cell with a clock: `12:00:05.2`, `10/24/2026 11:59 PM`, `2026-10-24T23:59:30+02:00`."""

import re
from dataclasses import dataclass

_HOURS_OF_HALF_DAY = 12
#: First of the two-digit years that belong to the last century, as in POSIX.
_PIVOT_YEAR = 69

#: First letters of the months' names in English, German and French.
_MONTHS = {
    letters: number
    for number, names in enumerate(
        (
            "jan", "feb fév fev", "mar mär mrz", "apr avr", "may mai", "jun juin", "jul juil",
            "aug aoû aou", "sep", "oct okt", "nov", "dec dez déc",
        ),
        start=1,
    )
    for letters in names.split()
}  # fmt: skip
#: Hours ahead of UTC by the names that clocks print; where one changes, summer time does.
_ZONES_H = {
    "Z": 0, "UTC": 0, "UT": 0, "GMT": 0, "WET": 0, "WEST": 1, "BST": 1, "CET": 1, "MEZ": 1,
    "CEST": 2, "MESZ": 2, "EET": 2, "EEST": 3, "MSK": 3, "JST": 9, "EST": -5, "EDT": -4,
    "CST": -6, "CDT": -5, "MST": -7, "MDT": -6, "PST": -8, "PDT": -7,
}  # fmt: skip

_WEEKDAY = re.compile(r"[^\W\d_]{2,10}\.?,?\s+(?=\d)")
#: As C's `ctime` and the shell's `date` print it: `Sat Oct 24 23:59:30 CEST 2026`.
_YEAR_LAST = re.compile(r"([^\W\d_]{3} \d{1,2}) (\d\d?:\d\d:\d\d\S*(?: [A-Z]{3,4})?) (\d{4})")
_NAMED_MONTH = re.compile(
    r"(?:(?P<d>\d{1,2})\.?[\s\-/]*(?P<m>[^\W\d_]{3,9})\.?[\s,\-/]+"
    r"|(?P<m2>[^\W\d_]{3,9})\.?\s+(?P<d2>\d{1,2}),?\s+)(?P<y>\d{4}|\d\d(?!:))(?!\d)"
)
_BASIC = re.compile(r"(\d{8})[T_](\d\d)(\d\d)(\d\d)")
#: `20261024235930`, which no count of seconds reaches.
_DIGITS = re.compile(
    r"((?:19|20)\d\d(?:0[1-9]|1[0-2])(?:0[1-9]|[12]\d|3[01]))([01]\d|2[0-3])([0-5]\d)([0-5]\d)"
)
_DATE = r"(?P<d1>\d{4}|\d\d?)(?P<mark>[-/.])(?P<d2>\d\d?)(?P=mark)(?P<d3>\d{4}|\d\d?)\.?"
_ANY_DATE = rf"(?:{_DATE}|(?P<compact>\d{{8}}))"
_TIME = (
    r"(?P<a>\d{1,3}):(?P<b>[0-5]\d)"
    r"(?::(?P<c>[0-5]\d)(?:[.,](?P<f>\d*)|:(?P<ms>\d{3}))?|[.,](?P<g>\d+))?"
    r"(?:\s*(?P<half>[AaPp])\.?\s?[Mm]\.?)?(?:\s*(?:Uhr|h))?"
)
_ZONE = (
    r"(?:\s*(?P<zone>Z|UTC|UT|GMT|[A-Z]{3,4})?(?P<offset>[+\-]\d\d?(?::?\d\d)?)?(?:\[[\w/]+\])?)?"
)
_FORMS = (
    re.compile(rf"(?:{_ANY_DATE}(?:T|[\s,;_]+|[-:](?=\d\d?:)))?{_TIME}{_ZONE}"),
    re.compile(rf"{_TIME}{_ZONE}[\s,;]+{_ANY_DATE}"),
    re.compile(_DATE),
)


@dataclass(frozen=True)
class ClockReading:
    """Content of a cell with a clock, before it is known which number is which.

    Attributes
    ----------
    date
        Its three numbers as they are written; empty without a date.
    parts
        Two or three numbers of the time; empty where only a date is given, which is midnight.
    fraction
        Digits of the fraction of the last part.
    half
        `a` or `p` of a 12-hour clock; empty for one of 24 hours.
    offset_s
        Seconds ahead of UTC; None if the cell does not say it.
    zone
        Name of a zone whose offset is not known.
    """

    date: tuple[str, ...]
    parts: tuple[int, ...]
    fraction: str
    half: str
    offset_s: int | None
    zone: str


def parse_clock(cell: str) -> ClockReading | None:
    """Return what a cell with a clock says; None if it is none.

    Examples
    --------
    >>> from labrig.text_table.times.clock_reading import parse_clock
    >>> reading = parse_clock("24.10.2026 11:59:30,5 PM")
    >>> reading.date, reading.parts, reading.fraction, reading.half
    (('24', '10', '2026'), (11, 59, 30), '5', 'p')
    >>> parse_clock("995.679") is None
    True
    """
    text = " ".join(cell.replace("\N{MINUS SIGN}", "-").split())
    if digits := _DIGITS.fullmatch(text):
        text = "{} {}:{}:{}".format(*digits.groups())
    text = _YEAR_LAST.sub(r"\1, \3 \2", _BASIC.sub(r"\1 \2:\3:\4", text))
    text = _WEEKDAY.sub("", _NAMED_MONTH.sub(_as_iso, text, count=1), count=1)
    for form in _FORMS:
        if match := form.fullmatch(text):
            return _reading(match.groupdict())
    return None


def full_year(text: str) -> int:
    """Return the year that two or four digits stand for."""
    year = int(text)
    if len(text) > len("yy"):
        return year
    return year + (1900 if year >= _PIVOT_YEAR else 2000)


def _as_iso(match: re.Match[str]) -> str:
    """Return a date with the name of its month in the order year, month, day."""
    month = (match["m"] or match["m2"]).lower()
    number = _MONTHS.get(month[:4]) or _MONTHS.get(month[:3])
    if number is None:
        return match[0]
    return f"{full_year(match['y']):04d}-{number:02d}-{int(match['d'] or match['d2']):02d}"


def _reading(found: dict[str, str | None]) -> ClockReading | None:
    compact = found.get("compact")
    date = tuple(found[name] or "" for name in ("d1", "d2", "d3")) if found["d1"] else ()
    if compact:
        date = (compact[:4], compact[4:6], compact[6:])
    parts = tuple(int(found[name] or 0) for name in "abc" if found.get(name) is not None)
    half = (found.get("half") or "").lower()
    if half and parts[0] > _HOURS_OF_HALF_DAY:
        return None
    zone, offset = found.get("zone") or "", found.get("offset") or ""
    hours = _ZONES_H.get(zone)
    offset_s = None if hours is None and (zone or not offset) else 3600 * (hours or 0)
    if offset and offset_s is not None:
        offset_s += _seconds(offset)
    return ClockReading(
        date=date,
        parts=parts,
        fraction=found.get("f") or found.get("ms") or found.get("g") or "",
        half=half,
        offset_s=offset_s,
        zone=zone if hours is None else "",
    )


def _seconds(offset: str) -> int:
    """Return the seconds of an offset from UTC such as `+02:00` or `-0530`."""
    digits = offset[1:].replace(":", "")
    hours, minutes = (int(digits[:-2]), int(digits[-2:])) if len(digits) > 2 else (int(digits), 0)
    return (-1 if offset[0] == "-" else 1) * (3600 * hours + 60 * minutes)
