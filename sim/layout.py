"""Layout of the picture: samples, the strip of the LVF on them and before them, cards."""

from dataclasses import dataclass

import numpy as np

from labrig.foundation.arrays import IntArray
from labrig.foundation.region import region_pixels

from .arrangement import Arrangement, Card, LvfPlace
from .cards import surfaces
from .lvf import PIECES, pieces
from .sensor import BAYER_RGGB
from .simulation import Simulation


@dataclass(frozen=True)
class Places:
    """All parts of a picture that can look different, arrays of shape (places,).

    Attributes
    ----------
    cell
        Index of the cell at each place, see `Layout`.
    surface
        Index of the card's surface on it, see `cards`; 0 for none.
    piece
        Index of the piece of the LVF's strip before it, see `lvf`.
    painted : ndarray, shape (height, width)
        For every pixel 4 times its place, plus its index among the four pixels of a Bayer cell.
    """

    cell: IntArray
    surface: IntArray
    piece: IntArray
    painted: IntArray


class Layout:
    """Cells of the picture: the cloth, and each part of a sample below its own piece of the strip.

    Attributes
    ----------
    patch, piece : ndarray, shape (cells,)
        Sample of every cell, from 1 on, and the piece of the strip on it; cell 0 is the cloth.
        Without an LVF a sample is one cell.
    pixels : ndarray, shape (cells,)
        Number of pixels of a cell.

    Raises
    ------
    UsageError
        A patch or a strip is outside the frame.
    """

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._size = simulation.sensor.width, simulation.sensor.height
        width, height = self._size
        patch = np.zeros((height, width), dtype=np.intp)
        for number, placed in enumerate(simulation.patches, start=1):
            x, y, wide, high = region_pixels(placed.region, width, height)
            patch[y : y + high, x : x + wide] = number  # a later patch lies on an earlier one
        lvf = simulation.lvf
        self._strips = {} if lvf is None else {
            "before camera": pieces(lvf.before_camera, width, height),
            "on sample": pieces(lvf.on_sample, width, height),
        }  # fmt: skip
        numbers = patch * (PIECES + 1)
        if lvf is not None:
            numbers += np.where(patch > 0, self._strips["on sample"], 0)
        # The cloth and every patch have a cell, even one that others hide.
        every = np.arange(len(simulation.patches) + 1) * (PIECES + 1)
        pixels = np.bincount(numbers.ravel(), minlength=int(every[-1]) + 1)
        cells = np.union1d(np.flatnonzero(pixels), every)
        self._cells = np.searchsorted(cells, numbers)
        self.patch, self.piece = np.divmod(cells, PIECES + 1)
        self.pixels = pixels[cells]
        self._places_by_arrangement: dict[tuple[Card, int, LvfPlace], Places] = {}

    def places(self, arrangement: Arrangement) -> Places:
        """Return all places that look different in an arrangement."""
        through = self.looked_through(arrangement)
        key = arrangement.card, arrangement.chart_patch, through
        if key not in self._places_by_arrangement:
            self._places_by_arrangement[key] = self._places(*key)
        return self._places_by_arrangement[key]

    def looked_through(self, arrangement: Arrangement) -> LvfPlace:
        """Return the LVF's place if the camera looks through it, else `away`.

        Without a door the sample does not leave an LVF that lies on it.
        """
        if arrangement.lvf == "on sample" and self._simulation.door is not None:
            return "away"
        return arrangement.lvf

    def _places(self, card: Card, chart_patch: int, through: LvfPlace) -> Places:
        width, height = self._size
        chart, black_trap = self._simulation.chart, self._simulation.black_trap
        surface = surfaces(card, chart, width, height, black_trap, chart_patch)
        piece = self._strips.get(through, np.zeros_like(surface))
        numbers = (self._cells * (surface.max() + 1) + surface) * (PIECES + 1) + piece
        distinct = np.flatnonzero(np.bincount(numbers.ravel()))
        place = np.searchsorted(distinct, numbers)
        remainder, pieces_found = np.divmod(distinct, PIECES + 1)
        cells_found, surfaces_found = np.divmod(remainder, surface.max() + 1)
        bayer = np.tile(np.arange(len(BAYER_RGGB)).reshape(2, 2), (height // 2, width // 2))
        painted = place * len(BAYER_RGGB) + bayer
        return Places(cells_found, surfaces_found, pieces_found, painted)
