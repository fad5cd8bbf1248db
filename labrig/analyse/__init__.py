"""From the frames of a run to its typed result: one module or package for each protocol."""

from labrig.analyse.bench_reference import reference_of
from labrig.analyse.charge_table import ChargeTableOptions, fit_charge_table
from labrig.analyse.frames import verify_frames
from labrig.analyse.hyperspectral import CubeList, matrix_from_cubes
from labrig.analyse.inputs import Inputs, Part
from labrig.analyse.luminance_table import LuminanceTableOptions, evaluate_luminance_table
from labrig.analyse.overrides import Overrides, read_run_protocol
from labrig.analyse.process_options import (
    ProcessOptions,
    check_options,
    chosen_options,
    flag,
    options_of,
)
from labrig.analyse.raw_agreement import (
    clock_warnings,
    require_recorded_settings,
    settings_differences,
    spectra_differences,
)
from labrig.analyse.series_fit import fit_series
from labrig.analyse.shared_tables import fit_shared_tables
from labrig.analyse.table_fit import FittedTable, TableFitOptions, fit_table
from labrig.analyse.temperature import temperature_warnings

__all__ = [
    "ChargeTableOptions",
    "CubeList",
    "FittedTable",
    "Inputs",
    "LuminanceTableOptions",
    "Overrides",
    "Part",
    "ProcessOptions",
    "TableFitOptions",
    "check_options",
    "chosen_options",
    "clock_warnings",
    "evaluate_luminance_table",
    "fit_charge_table",
    "fit_series",
    "fit_shared_tables",
    "fit_table",
    "flag",
    "matrix_from_cubes",
    "options_of",
    "read_run_protocol",
    "reference_of",
    "require_recorded_settings",
    "settings_differences",
    "spectra_differences",
    "temperature_warnings",
    "verify_frames",
]
