from .bench_reference import reference_of as reference_of
from .charge_table import (
    ChargeTableOptions as ChargeTableOptions,
    fit_charge_table as fit_charge_table,
)
from .frames import intact_frames as intact_frames, verify_frames as verify_frames
from .hyperspectral import (
    CubeList as CubeList,
    matrix_from_cubes as matrix_from_cubes,
)
from .inputs import (
    AnalysisContext as AnalysisContext,
    Inputs as Inputs,
    analyse_part as analyse_part,
)
from .luminance_table import (
    LuminanceTableOptions as LuminanceTableOptions,
    evaluate_luminance_table as evaluate_luminance_table,
)
from .overrides import (
    Overrides as Overrides,
)
from .process_options import (
    ProcessOptions as ProcessOptions,
    check_options as check_options,
    chosen_options as chosen_options,
    flag as flag,
    options_of as options_of,
)
from .raw_agreement import (
    clock_warnings as clock_warnings,
    require_recorded_settings as require_recorded_settings,
    settings_differences as settings_differences,
    spectra_differences as spectra_differences,
)
from .series_fit import fit_series as fit_series
from .shared_tables import fit_shared_tables as fit_shared_tables
from .table_fit import (
    FittedTable as FittedTable,
    TableFitOptions as TableFitOptions,
    fit_table as fit_table,
)
from .temperature import temperature_warnings as temperature_warnings
