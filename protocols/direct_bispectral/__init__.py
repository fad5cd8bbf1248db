"""Measurement of direct bispectral measurement."""

from labrig.foundation.plugins import Measurement

DIRECT_BISPECTRAL = Measurement(
    package=__name__,
    protocol=".protocol:DirectBispectral",
    result=".result:DirectBispectralResult",
    is_of_fluorescence=True,
)
