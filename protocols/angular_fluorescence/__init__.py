"""Measurement of fluorescence by the angle of view."""

from labrig.foundation.plugins import Measurement

ANGULAR_FLUORESCENCE = Measurement(
    package=__name__,
    protocol=".protocol:AngularFluorescence",
    result=".result:AngularFluorescenceResult",
    is_of_fluorescence=True,
)
