"""Measurement of the spectral curves of a camera."""

from labrig.foundation.plugins import Measurement

CAMERA_CURVES = Measurement(
    package=__name__,
    protocol=".protocol:CameraCurves",
    result=".result:CameraCurvesResult",
    of="bench",
)
