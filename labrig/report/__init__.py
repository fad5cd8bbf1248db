"""The report of a run: what was measured, for people."""

from labrig.report.content import (
    DECAY_ASSUMPTIONS,
    DeviceLine,
    GlowPhotograph,
    Interruption,
    PatchReport,
    RunReport,
)
from labrig.report.page import write_report

__all__ = [
    "DECAY_ASSUMPTIONS",
    "DeviceLine",
    "GlowPhotograph",
    "Interruption",
    "PatchReport",
    "RunReport",
    "write_report",
]
