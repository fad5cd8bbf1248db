"""The report of a run: what was measured, for people."""

from labrig.report.content import (
    DECAY_ASSUMPTIONS,
    DeviceLine,
    GlowPhotograph,
    Interruption,
    PatchReport,
    RunReport,
)
from labrig.report.figure_style import figure_style
from labrig.report.page import write_report
from labrig.report.sections import Picture, Section, Table
from labrig.report.stage_page import StagePage, write_stage_page

__all__ = [
    "DECAY_ASSUMPTIONS",
    "DeviceLine",
    "GlowPhotograph",
    "Interruption",
    "PatchReport",
    "Picture",
    "RunReport",
    "Section",
    "StagePage",
    "Table",
    "figure_style",
    "write_report",
    "write_stage_page",
]
