"""What the analysis of one protocol is given."""

from dataclasses import dataclass
from typing import Any

from labrig.acquire import RigFile
from labrig.analyse.choices import Choices
from labrig.analyse.inputs import Inputs
from labrig.record import RunRecord


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
    """

    run: RunRecord
    protocol: Any
    rig: RigFile
    choices: Choices
    inputs: Inputs
