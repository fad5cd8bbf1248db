"""Run folder → reduce → fit → material → report."""

from labrig.process.choices import Choices
from labrig.process.result import Result
from labrig.process.run import process_run
from labrig.process.series_fit import fit_series, fit_table

__all__ = ["Choices", "Result", "fit_series", "fit_table", "process_run"]
