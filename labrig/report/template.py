"""What the templates of reports share."""

import re
import shlex
from datetime import UTC, datetime
from functools import cache
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup, escape

from labrig.quantity import duration_text
from labrig.record import FrameRecord
from labrig.report import parameters
from labrig.written_numbers import plus_minus, rounded

_FOLDER = Path(__file__).parent
_SYMBOL = re.compile(r"\b([a-z])_([a-z])\b")


@cache
def environment() -> Environment:
    """Templates of this folder, with the functions that all of them use."""
    made = Environment(
        loader=FileSystemLoader(_FOLDER),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.globals.update(
        duration_text=duration_text,
        plus_minus=plus_minus,
        rounded=rounded,
        utc=_utc,
        state_rows=parameters.state_rows,
        quality_rows=parameters.quality_rows,
        paper_rows=parameters.paper_rows,
        candidate_rows=parameters.candidate_rows,
        why_so_many_states=parameters.why_so_many_states,
    )
    made.filters["quoted"] = shlex.quote
    made.filters["indexed"] = _indexed
    made.filters["titled"] = _titled
    return made


def style() -> str:
    """The page's style sheet; labrig's own, so that it need not be escaped."""
    return (_FOLDER / "report.css").read_text(encoding="utf-8")


def script() -> str:
    """The page's script."""
    return (_FOLDER / "report.js").read_text(encoding="utf-8")


def dated_notes(text: str) -> list[tuple[str, str]]:
    """Heading and text of every note; what stands before the first heading has none."""
    before, *entries = re.split(r"^## +", text, flags=re.MULTILINE)
    split = (entry.partition("\n") for entry in entries)
    return [("", before.strip()), *((heading.strip(), rest.strip()) for heading, _, rest in split)]


def _indexed(text: str) -> Markup:
    """Symbols such as `k_i` with their index below the line."""
    return Markup(_SYMBOL.sub(r"<i>\1</i><sub><i>\2</i></sub>", str(escape(text))))


def _utc(frame: FrameRecord) -> str:
    """When the frame began."""
    start = datetime.fromtimestamp(frame.start_time, UTC)
    return start.strftime("%Y-%m-%d %H:%M:%S.%f")[:-3]


def _titled(name: str) -> str:
    """`Camera calibration` of `camera_calibration`."""
    words = name.replace("_", " ").capitalize()
    return words.replace("Lvf", "LVF")
