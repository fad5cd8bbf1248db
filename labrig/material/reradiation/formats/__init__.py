"""Formats of re-radiation matrices: Labsphere BFC, CSV, ART archives, EEM text, OpenEXR."""

from labrig.material.reradiation.formats.eem import MatrixLayout
from labrig.material.reradiation.formats.files import (
    matrix_files,
    read_reradiation,
    write_reradiation,
)
from labrig.material.reradiation.formats.spectral_exr import SpectralImage, read_spectral_image

__all__ = [
    "MatrixLayout",
    "SpectralImage",
    "matrix_files",
    "read_reradiation",
    "read_spectral_image",
    "write_reradiation",
]
