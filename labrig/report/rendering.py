"""What a protocol's part of a report is made from, and what it is."""

from dataclasses import dataclass
from typing import Any, Protocol

from labrig.acquire import RigFile
from labrig.optics import CameraResponse
from labrig.record import RunDescription, RunRecord
from labrig.report.sections import Section


@dataclass(frozen=True)
class Source:
    """What a result was found in.

    Attributes
    ----------
    run
        The protocol's part of the run; its photographs may be shown.
    protocol
        Its model.
    rig
        The bench as it was.
    about
        The run, its bench and what its result was made with.
    camera
        The camera's curves, for colours; None if they are not known.
    anchor
        Begins the names of places in the page that links lead to.
    """

    run: RunRecord
    protocol: Any
    rig: RigFile
    about: RunDescription
    camera: CameraResponse | None = None
    anchor: str = ""


@dataclass(frozen=True)
class Rendered:
    """A result for people.

    Attributes
    ----------
    sections
        Of the report, in this order.
    lines
        The numbers that matter, for the terminal.
    methods
        How it was done, for the end of the report.
    """

    sections: tuple[Section, ...]
    lines: tuple[str, ...]
    methods: tuple[Section, ...] = ()


class Renderer(Protocol):
    """A protocol's part of a report, registered in `labrig.reports` under the protocol's name."""

    def __call__(self, result: Any, source: Source, /) -> Rendered:
        """Show a result of the protocol's own type."""
