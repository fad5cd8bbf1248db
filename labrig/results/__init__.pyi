from .angular_fluorescence import (
    LEVEL as LEVEL,
    POWER as POWER,
    AngleMeans as AngleMeans,
    AngularFluorescenceResult as AngularFluorescenceResult,
    DependenceTest as DependenceTest,
    ShadingFit as ShadingFit,
    SphereViews as SphereViews,
    YarnViews as YarnViews,
)
from .blank import (
    BlankResult as BlankResult,
    StrayLight as StrayLight,
)
from .budget import (
    UNDIVIDED as UNDIVIDED,
    Budget as Budget,
)
from .calibration import CalibrationResult as CalibrationResult
from .calibration_check import (
    CalibrationCheckResult as CalibrationCheckResult,
    PictureChange as PictureChange,
)
from .camera_calibration import (
    CameraCalibrationResult as CameraCalibrationResult,
    FittedFlat as FittedFlat,
    PairScatter as PairScatter,
    PhotonTransfer as PhotonTransfer,
)
from .camera_curves import (
    CameraCurvesResult as CameraCurvesResult,
)
from .charging_series import (
    Charge as Charge,
    ChargingSeries as ChargingSeries,
    EarlierCharges as EarlierCharges,
    Transient as Transient,
)
from .colour_check import (
    CheckedColour as CheckedColour,
    CheckedPatch as CheckedPatch,
    ColourCheckResult as ColourCheckResult,
    ColourSummary as ColourSummary,
)
from .decay import (
    DecayPatch as DecayPatch,
    DecayResult as DecayResult,
    NoiseBudget as NoiseBudget,
)
from .decay_reference import DecayReference as DecayReference, first_row_at as first_row_at
from .direct_bispectral import (
    DirectBispectralResult as DirectBispectralResult,
    DirectColumns as DirectColumns,
    LightSpectrum as LightSpectrum,
)
from .emission_spectrum import (
    ChargeSpectrum as ChargeSpectrum,
    EmissionSpectrum as EmissionSpectrum,
    EmissionSpectrumResult as EmissionSpectrumResult,
    FilterFrames as FilterFrames,
    PatchSpectrum as PatchSpectrum,
    SpectralComparison as SpectralComparison,
)
from .excitation import (
    Closure as Closure,
    ExcitationResult as ExcitationResult,
    LightScatter as LightScatter,
    PatchCharging as PatchCharging,
    PatchExcitation as PatchExcitation,
    spans_decades as spans_decades,
)
from .fade import (
    FadeResult as FadeResult,
    FittedShape as FittedShape,
    LampChange as LampChange,
    SwitchedFrames as SwitchedFrames,
    WarmingLight as WarmingLight,
)
from .fitted_decay import (
    FORECAST_SPANS as FORECAST_SPANS,
    Candidate as Candidate,
    ComparedLaw as ComparedLaw,
    DecayState as DecayState,
    FittedDecay as FittedDecay,
    ScatterSigma as ScatterSigma,
    UnseenState as UnseenState,
    frames_for as frames_for,
)
from .fitted_decay_file import (
    find_fitted_decays as find_fitted_decays,
    fits_by_folder as fits_by_folder,
    read_fitted_decay as read_fitted_decay,
    read_fitted_decays as read_fitted_decays,
    write_fitted_decay as write_fitted_decay,
)
from .fitted_excitation import (
    SEEN_SIGMAS as SEEN_SIGMAS,
    UPPER_SIGMAS as UPPER_SIGMAS,
    BandQuantity as BandQuantity,
    BandTests as BandTests,
    ConcentrationAtOff as ConcentrationAtOff,
    ExcitationModel as ExcitationModel,
    ExcitedState as ExcitedState,
    FittedExcitation as FittedExcitation,
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
from .interval import (
    ASYMMETRIC as ASYMMETRIC,
    NORMAL_95 as NORMAL_95,
    ProfileInterval as ProfileInterval,
    interval_lines as interval_lines,
    interval_rows as interval_rows,
    read_intervals as read_intervals,
)
from .irradiance import (
    CardRatio as CardRatio,
    IrradianceResult as IrradianceResult,
    StripScale as StripScale,
)
from .isotropy import (
    PAPER_FLUCTUATION as PAPER_FLUCTUATION,
    AngularGlow as AngularGlow,
    IsotropyResult as IsotropyResult,
    is_within_paper as is_within_paper,
)
from .layer_effect import (
    PRIOR_DENSITY as PRIOR_DENSITY,
    THICKNESS as THICKNESS,
    DensityBasis as DensityBasis,
    LayerEffect as LayerEffect,
)
from .led_brightness import (
    LedBrightnessResult as LedBrightnessResult,
    LedFault as LedFault,
    LedFinding as LedFinding,
    LedMeasured as LedMeasured,
)
from .led_fluorescence import (
    ColourUnderLight as ColourUnderLight,
    FluorescentPatch as FluorescentPatch,
    LedFluorescenceResult as LedFluorescenceResult,
    MatrixOnBands as MatrixOnBands,
    MeasuredDye as MeasuredDye,
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
from .luminance_run import (
    ExcitationState as ExcitationState,
    LuminanceResult as LuminanceResult,
    PatchLuminance as PatchLuminance,
    ScaleFactor as ScaleFactor,
)
from .lvf_calibration import (
    CameraCurves as CameraCurves,
    FilterMisfit as FilterMisfit,
    LocatedLines as LocatedLines,
    LvfCalibrationResult as LvfCalibrationResult,
    PlacedStrip as PlacedStrip,
    SliceValues as SliceValues,
    Stripes as Stripes,
    StripLines as StripLines,
    StripProfile as StripProfile,
)
from .measured import (
    Measured as Measured,
    OneSided as OneSided,
    field_unit as field_unit,
    iter_values as iter_values,
    measured_number as measured_number,
    with_uncertainty as with_uncertainty,
)
from .phosphor import (
    PhosphorResult as PhosphorResult,
)
from .reflectance import (
    MeasuredReflectance as MeasuredReflectance,
    ReflectanceResult as ReflectanceResult,
)
from .reradiation_methods import (
    EstimateMethod as EstimateMethod,
    MeasuringMethod as MeasuringMethod,
    MethodDifference as MethodDifference,
    MixtureOfMatrix as MixtureOfMatrix,
    ReradiatedSpectrum as ReradiatedSpectrum,
    ReradiationUnderLight as ReradiationUnderLight,
)
from .run_result import (
    AnyResult as AnyResult,
    RunResult as RunResult,
    read_result as read_result,
    write_result as write_result,
)
from .saturation import (
    FULL_LIGHT as FULL_LIGHT,
    LIGHTS as LIGHTS,
    Concentration as Concentration,
    Curve as Curve,
    OrderTest as OrderTest,
    PatchSaturation as PatchSaturation,
    RatesTest as RatesTest,
    SaturationResult as SaturationResult,
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
from .shared_decay import SharedDecay as SharedDecay, TableDecay as TableDecay
from .summary import (
    SUMMARY as SUMMARY,
    read_summary as read_summary,
    write_summary as write_summary,
)
from .table_clock import TableClock as TableClock
from .table_layout import (
    TableLayout as TableLayout,
)
from .text_files import (
    write_csv as write_csv,
)
from .trap_depth import (
    StateDepth as StateDepth,
    TrapDepth as TrapDepth,
    state_name as state_name,
    trap_depths_json as trap_depths_json,
)
from .unseen_flicker import UnseenFlicker as UnseenFlicker
from .validate_illuminants import (
    LampComparison as LampComparison,
    LampPatch as LampPatch,
    SeenColour as SeenColour,
    ValidatedSample as ValidatedSample,
    ValidateIlluminantsResult as ValidateIlluminantsResult,
)
