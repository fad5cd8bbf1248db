from .angular_dependence import (
    LEVEL as LEVEL,
    POWER as POWER,
    AngleMeans as AngleMeans,
    DependenceTest as DependenceTest,
    ShadingFit as ShadingFit,
)
from .budget import (
    UNDIVIDED as UNDIVIDED,
    Budget as Budget,
)
from .charging_series import (
    Charge as Charge,
    ChargingSeries as ChargingSeries,
    EarlierCharges as EarlierCharges,
    Transient as Transient,
)
from .decay_patch import (
    DecayPatch as DecayPatch,
    NoiseBudget as NoiseBudget,
    ResultWithDecays as ResultWithDecays,
)
from .decay_reference import (
    DecayReference as DecayReference,
    UnseenFlicker as UnseenFlicker,
    first_row_at as first_row_at,
)
from .direct_columns import (
    DirectColumns as DirectColumns,
    DirectMeasurement as DirectMeasurement,
    LightSpectrum as LightSpectrum,
)
from .emission_spectrum import (
    EmissionSpectrum as EmissionSpectrum,
    FilterFrames as FilterFrames,
    SpectralComparison as SpectralComparison,
)
from .fitted_decay import (
    FORECAST_SPANS as FORECAST_SPANS,
    Candidate as Candidate,
    ComparedLaw as ComparedLaw,
    DecayState as DecayState,
    FittedDecay as FittedDecay,
    ScatterSigma as ScatterSigma,
    UnseenState as UnseenState,
    recommended_sampling as recommended_sampling,
)
from .fitted_decay_file import (
    find_fitted_decays as find_fitted_decays,
    fits_by_folder as fits_by_folder,
    read_fitted_decay as read_fitted_decay,
    read_fitted_decays as read_fitted_decays,
    write_fitted_decay as write_fitted_decay,
)
from .fitted_excitation import (
    PRIOR_DENSITY as PRIOR_DENSITY,
    THICKNESS as THICKNESS,
    UPPER_SIGMAS as UPPER_SIGMAS,
    BandQuantity as BandQuantity,
    BandTests as BandTests,
    Closure as Closure,
    ConcentrationAtOff as ConcentrationAtOff,
    DensityBasis as DensityBasis,
    ExcitationModel as ExcitationModel,
    ExcitedState as ExcitedState,
    FittedExcitation as FittedExcitation,
    LayerEffect as LayerEffect,
    order_fields as order_fields,
    spans_decades as spans_decades,
)
from .fitted_law import (
    AUTO as AUTO,
    EXPONENTIALS as EXPONENTIALS,
    LAW_CHOICES as LAW_CHOICES,
    LAW_LABELS as LAW_LABELS,
    LAW_NAMES as LAW_NAMES,
    LAW_SYMBOLS as LAW_SYMBOLS,
    RATE_SPECTRUM as RATE_SPECTRUM,
    DecayForecast as DecayForecast,
    FittedLaw as FittedLaw,
    FittedRateSpectrum as FittedRateSpectrum,
    interval_name as interval_name,
    parameter_text as parameter_text,
    require_law as require_law,
)
from .fluorescent_patch import (
    ColourUnderLight as ColourUnderLight,
    EstimateMethod as EstimateMethod,
    FluorescentPatch as FluorescentPatch,
    MatrixOnBands as MatrixOnBands,
    MeasuredDye as MeasuredDye,
    MeasuringMethod as MeasuringMethod,
    MethodDifference as MethodDifference,
    MixtureOfMatrix as MixtureOfMatrix,
    ReradiatedSpectrum as ReradiatedSpectrum,
    ReradiationUnderLight as ReradiationUnderLight,
)
from .headline_values import (
    headline_values as headline_values,
)
from .interval import (
    ASYMMETRIC as ASYMMETRIC,
    NORMAL_95 as NORMAL_95,
    ProfileInterval as ProfileInterval,
    interval_lines as interval_lines,
    interval_rows as interval_rows,
    read_intervals as read_intervals,
)
from .luminance import (
    MARKING_S as MARKING_S,
    MCD_PER_M2 as MCD_PER_M2,
    TABLE_S as TABLE_S,
    VISIBLE_MCD_PER_M2 as VISIBLE_MCD_PER_M2,
    ForecastTime as ForecastTime,
    LuminanceAt as LuminanceAt,
    LuminanceDecay as LuminanceDecay,
    LuminanceRequirement as LuminanceRequirement,
    Verdict as Verdict,
    luminance_requirement as luminance_requirement,
    luminance_unit as luminance_unit,
)
from .measured import (
    ONE_SIDED_SIGMAS as ONE_SIDED_SIGMAS,
    ONLY as ONLY,
    Measured as Measured,
    OneSided as OneSided,
    field_unit as field_unit,
    iter_values as iter_values,
    measured_number as measured_number,
    with_uncertainty as with_uncertainty,
)
from .quantities import (
    SIGMA as SIGMA,
    Quantity as Quantity,
    Units as Units,
    coordinates_by_length as coordinates_by_length,
    iter_quantities as iter_quantities,
    number_array as number_array,
)
from .run_result import (
    AnyResult as AnyResult,
    ChainResult as ChainResult,
    RunResult as RunResult,
    read_result as read_result,
    write_result as write_result,
)
from .series import (
    Series as Series,
    add_flag as add_flag,
    is_usable as is_usable,
    write_series as write_series,
)
from .series_table import (
    join_series as join_series,
    parse_series as parse_series,
    read_described_series as read_described_series,
    read_series as read_series,
)
from .shared_decay import (
    SharedDecay as SharedDecay,
    TableDecay as TableDecay,
)
from .strip_profile import (
    LocatedLines as LocatedLines,
    PictureChange as PictureChange,
    SliceValues as SliceValues,
    StripProfile as StripProfile,
)
from .summary import (
    SAMPLE_PICTURE as SAMPLE_PICTURE,
    SUMMARY as SUMMARY,
    read_summary as read_summary,
    write_summary as write_summary,
)
from .table_clock import (
    TableClock as TableClock,
)
from .text_files import (
    write_csv as write_csv,
)
from .time_axis import (
    TableLayout as TableLayout,
)
from .trap_depth import (
    StateDepth as StateDepth,
    TrapDepth as TrapDepth,
    state_name as state_name,
    trap_depths_json as trap_depths_json,
)
from .under_lamps import (
    LampComparison as LampComparison,
    LampPatch as LampPatch,
    PredictedUnderLamps as PredictedUnderLamps,
    SeenColour as SeenColour,
    ValidatedSample as ValidatedSample,
)
