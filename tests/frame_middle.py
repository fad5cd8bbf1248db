"""Light in the middle of a small RAW frame."""

import io
from pathlib import Path

import rawpy


def middle_dn(path: Path) -> float:
    """Return the mean of the middle of a frame of 96 × 64 pixels in DN above black."""
    with rawpy.imread(io.BytesIO(path.read_bytes())) as raw:
        return float(raw.raw_image_visible[20:44, 30:66].mean()) - 1024
