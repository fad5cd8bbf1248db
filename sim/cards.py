"""Cards before lamp and camera: a grey card, a ColorChecker."""

import numpy as np

from labrig.foundation.arrays import FloatArray, IntArray
from labrig.foundation.region import Region, region_pixels

from .arrangement import Card
from .lamp import WAVELENGTH_NM

#: Rows and columns of a ColorChecker; its patches leave this part of their distance to the frame.
ROWS, COLUMNS = 4, 6
PATCHES = ROWS * COLUMNS
FRAME = 0.12
FRAME_REFLECTANCE = 0.04

#: A grey card's reflectance over its nominal one.
GREY_NM = (380.0, 420.0, 480.0, 560.0, 640.0, 700.0, 780.0)
GREY = (0.972, 0.995, 1.003, 1.0, 0.998, 1.0, 1.008)

#: An optical brightener: light that it absorbs, and middle and width (1 σ) of what it re-radiates.
BRIGHTENED = WAVELENGTH_NM < 430.0
BRIGHTENER_NM, BRIGHTENER_SIGMA_NM = 440.0, 18.0


def brightened(light: FloatArray, fraction: float) -> FloatArray:
    """Return what a brightener re-radiates of light (…, wavelengths), as from a white card."""
    shape = np.exp(-(((WAVELENGTH_NM - BRIGHTENER_NM) / BRIGHTENER_SIGMA_NM) ** 2) / 2)
    absorbed = fraction * light[..., BRIGHTENED].sum(axis=-1, keepdims=True)
    return np.asarray(absorbed * shape / shape.sum())


def reflectances(card: Card, grey: float) -> FloatArray:
    """Return reflectances of all surfaces of a card, shape (surfaces, wavelengths).

    Surface 0 is outside of the card, and 0. A grey card, or a blank of the same, is surface 1, and
    the black trap in it 2; of a ColorChecker, row by row, 1 to 24, its frame is 25.
    """
    nothing = np.zeros((1, len(WAVELENGTH_NM)))
    if card in ("sample", "lit sample"):
        return nothing
    if card == "colorchecker":
        frame = np.full((1, len(WAVELENGTH_NM)), FRAME_REFLECTANCE)
        return np.concatenate([nothing, _colorchecker(), frame])
    card_reflectance = grey * np.interp(WAVELENGTH_NM, GREY_NM, GREY)[None, :]
    return np.concatenate([nothing, card_reflectance, nothing])


def surfaces(
    card: Card,
    chart: Region,
    width: int,
    height: int,
    black_trap: Region | None = None,
    chart_patch: int = 0,
) -> IntArray:
    """Return the surface of a card on top in every pixel, shape (height, width).

    A grey card fills the picture but for the trap, a ColorChecker its region, or one of its patches
    the picture. A blank lies below.
    """
    surface = np.zeros((height, width), dtype=np.intp)
    if card == "grey card":
        surface[:] = 1
        if black_trap is not None:
            x, y, wide, high = region_pixels(black_trap, width, height)
            surface[y : y + high, x : x + wide] = 2
    elif card == "colorchecker" and chart_patch:
        surface[:] = chart_patch
    elif card == "colorchecker":
        x, y, wide, high = region_pixels(chart, width, height)
        row, in_row = np.divmod((np.arange(high) + 0.5) / high * ROWS, 1)
        column, in_column = np.divmod((np.arange(wide) + 0.5) / wide * COLUMNS, 1)
        number = 1 + row.astype(np.intp)[:, None] * COLUMNS + column.astype(np.intp)
        inside = (np.abs(in_row - 0.5) < 0.5 - FRAME)[:, None] & (
            np.abs(in_column - 0.5) < 0.5 - FRAME
        )
        surface[y : y + high, x : x + wide] = np.where(inside, number, 1 + ROWS * COLUMNS)
    return surface


def _colorchecker() -> FloatArray:
    """Return BabelColor's means over 30 ColorCheckers, constant at the ends, (24, wavelengths)."""
    # Takes seconds to load, and would change how NumPy prints.
    with np.printoptions():
        import colour

    patches = colour.SDS_COLOURCHECKERS["BabelColor Average"].values()
    return np.array(
        [np.interp(WAVELENGTH_NM, patch.wavelengths, patch.values) for patch in patches]
    )
