"""Registration of the measurement `camera_curves`."""

from labrig.foundation.plugins import Measurement

CAMERA_CURVES = Measurement(
    package=__package__,
    protocol=".protocol:CameraCurves",
    result=".result:CameraCurvesResult",
    of="bench",
)
