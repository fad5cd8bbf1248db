"""What processing a run gave."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from labrig.fit import DecayFit
from labrig.results import Series


@dataclass(frozen=True)
class Result:
    """What came out of a run.

    Attributes
    ----------
    report
        The page.
    lines
        The numbers that matter, for the terminal.
    run_warnings
        About everything but the fits, which have warnings of their own.
    changes
        What is other than in the result before, if there was one.
    series, fits
        Of a decay, by the name of its patch.
    """

    report: Path
    lines: tuple[str, ...]
    run_warnings: tuple[str, ...]
    changes: tuple[str, ...]
    series: Mapping[str, Series] = field(default_factory=dict)
    fits: Mapping[str, DecayFit] = field(default_factory=dict)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Until all protocols have a typed result."""
        return self.run_warnings

    def to_json(self) -> str:
        """Until all protocols have a typed result."""
        from json import dumps

        fits = ", ".join(f'"{name}": {fit.to_json()}' for name, fit in self.fits.items())
        told = {"lines": self.lines, "warnings": self.run_warnings}
        return f"{{{fits}}}" if self.fits else dumps(told, ensure_ascii=False)
