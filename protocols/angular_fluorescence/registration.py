"""Registration of the measurement `angular_fluorescence`."""

from labrig.foundation.plugins import Measurement

ANGULAR_FLUORESCENCE = Measurement(
    package=__package__,
    protocol=".protocol:AngularFluorescence",
    result=".result:AngularFluorescenceResult",
    is_of_fluorescence=True,
)
