"""From columns of light to those of reflected and of re-radiated light."""

from collections.abc import Sequence

from labrig.fit.bispectral import BispectralColumns, separate_columns
from labrig.results import DirectColumns, Measured


def direct_columns(
    lights: Sequence[str], columns: BispectralColumns, drift: Measured
) -> DirectColumns:
    """Return columns with reflected and re-radiated light taken apart; `lights` in their order."""
    separated = separate_columns(columns)
    return DirectColumns(
        lights=tuple(lights),
        input_nm=columns.light_nm,
        output_nm=columns.output_nm,
        column=columns.column,
        column_sigma=columns.column_sigma,
        share=columns.share,
        is_mixed=separated.is_mixed,
        reflectance=separated.reflectance,
        reflectance_sigma=separated.reflectance_sigma,
        reradiated=separated.reradiated,
        reradiated_sigma=separated.reradiated_sigma,
        common_sigma=columns.common_sigma,
        light_sigma=columns.power_sigma / columns.power,
        drift=drift,
    )
