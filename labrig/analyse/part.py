"""What the processing of one protocol is given, and what it gives back."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from labrig.acquire import RigFile
from labrig.analyse.choices import Choices
from labrig.analyse.inputs import Inputs
from labrig.record import RunRecord
from labrig.report.sections import Section


@dataclass(frozen=True)
class Part:
    """One protocol's part of a run; all of it, unless it is a chain.

    Attributes
    ----------
    run
        Its units alone, by their own names.
    protocol
        Its model.
    rig
        The bench as it was.
    choices
        What a person wants otherwise.
    inputs
        Calibrations that the rig file names, and what earlier parts of a chain found.
    folder
        An empty folder for its files; for analyses that still write them themselves.
    """

    run: RunRecord
    protocol: Any
    rig: RigFile
    choices: Choices
    inputs: Inputs
    folder: Path = Path()


@dataclass(frozen=True)
class StageResult:
    """What came out.

    Attributes
    ----------
    known
        What was known before, and what is known now.
    sections
        Of the report.
    lines
        The numbers that matter, for the terminal.
    warnings
        What is odd and what to do about it, a line each.
    """

    known: Inputs
    sections: tuple[Section, ...] = ()
    lines: tuple[str, ...] = ()
    warnings: tuple[str, ...] = field(default=())
