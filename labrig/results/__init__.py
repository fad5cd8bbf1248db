"""What was found, as frozen values with uncertainties and units; one reader and writer a file."""

from labrig.results.arrays import BoolArray, FloatArray, IntArray
from labrig.results.charging_series import Charge, ChargingSeries, Transient
from labrig.results.closure import Closure
from labrig.results.fields import leaves, unit_of
from labrig.results.fitted_decay import (
    Candidate,
    DecayState,
    FittedDecay,
    Rival,
    find_fitted_decays,
    read_fitted_decay,
    read_fitted_decays,
    write_fitted_decay,
)
from labrig.results.fitted_excitation import ExcitedState, FittedExcitation, LevelAtOff
from labrig.results.joined_series import joined
from labrig.results.measured import Measured, with_uncertainty
from labrig.results.run_result import AnyResult, RunResult, read_result, write_result
from labrig.results.series import Series, add_flag, is_usable, write_series
from labrig.results.series_table import parse_series, read_series

__all__ = [
    "AnyResult",
    "BoolArray",
    "Candidate",
    "Charge",
    "ChargingSeries",
    "Closure",
    "DecayState",
    "ExcitedState",
    "FittedDecay",
    "FittedExcitation",
    "FloatArray",
    "IntArray",
    "LevelAtOff",
    "Measured",
    "Rival",
    "RunResult",
    "Series",
    "Transient",
    "add_flag",
    "find_fitted_decays",
    "is_usable",
    "joined",
    "leaves",
    "parse_series",
    "read_fitted_decay",
    "read_fitted_decays",
    "read_result",
    "read_series",
    "unit_of",
    "with_uncertainty",
    "write_fitted_decay",
    "write_result",
    "write_series",
]
