"""Re-radiation matrices measured column by column: one narrow-band light, one spectrum."""

from labrig.fit.bispectral.columns import (
    BispectralColumns,
    LitSpectrum,
    band_weights_nm,
    bispectral_columns,
    light_window_nm,
)
from labrig.fit.bispectral.separation import SeparatedColumns, separate_columns

__all__ = [
    "BispectralColumns",
    "LitSpectrum",
    "SeparatedColumns",
    "band_weights_nm",
    "bispectral_columns",
    "light_window_nm",
    "separate_columns",
]
