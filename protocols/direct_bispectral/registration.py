"""Registration of the measurement `direct_bispectral`."""

from labrig.foundation.plugins import Measurement

DIRECT_BISPECTRAL = Measurement(
    package=__package__,
    protocol=".protocol:DirectBispectral",
    result=".result:DirectBispectralResult",
    is_of_fluorescence=True,
)
