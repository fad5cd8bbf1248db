"""The report of a run: what was measured, for people; figures and words, from results."""

from labrig.report.figure_style import figure_style
from labrig.report.page import Report, write_report
from labrig.report.render import render
from labrig.report.rendering import Rendered, Source
from labrig.report.run_sections import lamp_sections, temperature_sections
from labrig.report.sections import Picture, Section, Table

__all__ = [
    "Picture",
    "Rendered",
    "Report",
    "Section",
    "Source",
    "Table",
    "figure_style",
    "lamp_sections",
    "render",
    "temperature_sections",
    "write_report",
]
