"""Matrices of a real instrument, in the folder of real data beside the repository."""

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from labrig.material import ReradiationMatrix
from tests.real_data import SHARED

FOLDER = SHARED / "bispectral/rit_bfc450"
INPUT_NM = np.arange(300.0, 781.0, 10.0)
OUTPUT_NM = np.arange(380.0, 781.0, 10.0)


def read(path: Path) -> ReradiationMatrix | None:
    """Return a matrix, None where rows are missing."""
    lines = path.read_text("latin-1").splitlines()
    header = next(i for i, line in enumerate(lines) if re.fullmatch(r"\s*(\d+\s+){5}\d+\s*", line))
    rows = [line.split()[1:] for line in lines[header + 2 : header + 43]]
    if {len(row) for row in rows} != {49}:
        return None
    values: NDArray[np.float64] = np.array(rows, dtype=np.float64)
    return ReradiationMatrix.from_bands(path.stem, INPUT_NM, OUTPUT_NM, values)


def samples() -> list[ReradiationMatrix]:
    """The 97 samples of all kinds."""
    return [_complete(path) for path in sorted(FOLDER.glob("*.BFC"))]


def tiles() -> Iterator[ReradiationMatrix]:
    """Ceramic tiles, in their measurements of 13 days; some files are there under two names."""
    contents = set()
    for path in sorted(FOLDER.glob("bcra_repeats/*/BC*.BFC")):
        tile = read(path)
        if tile is not None and tile.reradiation.tobytes() not in contents:
            contents.add(tile.reradiation.tobytes())
            yield tile


def _complete(path: Path) -> ReradiationMatrix:
    matrix = read(path)
    assert matrix is not None, path
    return matrix
