"""The calibration that the protocol makes: the drift of one lamp, in a file."""

from pydantic import Field

from labrig.calibration import CalibrationKind
from labrig.foundation.models import FrozenModel


class DriftFile(FrozenModel):
    """Content of `drift.yaml`.

    Attributes
    ----------
    drift_per_s, drift_per_s_sigma
        Change of the lamp's light relative to its mean, per second, and its standard uncertainty.
    """

    drift_per_s: float
    drift_per_s_sigma: float = Field(gt=0)


#: A rig file names it by `optics: {lamp_drift: …}`;
#: an analysis has it as `context.inputs[DRIFT_KIND]`.
DRIFT_KIND = CalibrationKind(
    name="lamp_drift",
    protocol="lamp_drift",
    optics_key="lamp_drift",
    file_name="drift.yaml",
    model=DriftFile,
)
