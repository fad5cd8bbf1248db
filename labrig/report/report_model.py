"""Content of a report of a decay, from its result and its run."""

from dataclasses import dataclass

from labrig.foundation.region import Region
from labrig.optics import CameraResponse
from labrig.record import FrameRecord, RunDescription
from labrig.results import FittedDecay, NoiseBudget, Series

#: Assumptions of every decay measured with a camera.
DECAY_ASSUMPTIONS = (
    "The amplitudes aᵢ are measured: they are the signal at lamp off in the brightest channel, "
    "extrapolated. They are products aᵢ = Λᵢ kᵢ rᵢ(0) with the rate kᵢ; re-radiation Λᵢ "
    "and concentration rᵢ(0) are not determined separately by a decay alone.",
    "A frame measures the mean over its exposure, and is fitted as such.",
    "Rates and amplitudes are shared by the channels; each channel has one weight. So every state "
    "is taken to have the same colour.",
    "Signals are relative: DN/s of this camera at the ISO speed and aperture listed below, not an "
    "absolute radiance.",
    "Uncertainties are standard uncertainties (1 σ) from photon, read and dark noise and, where it "
    "was fitted, the flicker that all channels of a frame share. They do not cover a wrong model, "
    "temperature or stray light.",
)

#: Assumptions of a decay from another program's table.
TABLE_ASSUMPTIONS = (
    "The amplitudes aᵢ are the signal at lamp off in the unit of the table, extrapolated. Where "
    "the table's clock does not include lamp off, they are those at the first row, from which all "
    "times count here, and laws that are no sum of exponentials are taken to begin there.",
    "Times and values are as they stand in the table; where it has no exposures, a value is taken "
    "to be momentary.",
    "Uncertainties are standard uncertainties (1 σ). They do not cover a wrong model, temperature "
    "or stray light.",
)


@dataclass(frozen=True)
class GlowPhotograph:
    """Frame of the glow that is shown.

    Attributes
    ----------
    frame
        Frame of the decay.
    t_s
        Start of the exposure in seconds after lamp off.
    """

    frame: FrameRecord
    t_s: float


@dataclass(frozen=True)
class PatchReport:
    """Patch of the sample.

    Attributes
    ----------
    name
        Name of the patch in the protocol.
    region
        Region of the patch in the photographs; None if not known.
    series
        Signals of the patch in DN/s.
    fit
        Fitted decay, or the reason why there is none.
    noise
        Components of σ; None if they are not known.
    """

    name: str
    region: Region | None
    series: Series
    fit: FittedDecay | str
    noise: NoiseBudget | None = None


@dataclass(frozen=True)
class DecayReport:
    """Decay as measured and fitted.

    Attributes
    ----------
    about
        Description of the run, its bench and the processing.
    patches
        Patches of the sample, at least one.
    frames
        All frames of the run; those of the role `decay` are used for the timing. Empty for a decay
        from another program's table.
    daylight
        Photographs under the lamp of different exposures; the best exposed one is shown.
    glow
        About six photographs of the glow in one decay, by rising time.
    camera
        Spectral responses of the camera, for colours; None if not known.
    charge_durations_s
        Measured length of the charge before each decay in s.
    background
        Region whose level was subtracted from each frame; None if dark frames were subtracted.
    states
        Number of states that the protocol sets; None if it was chosen from the data.
    """

    about: RunDescription
    patches: tuple[PatchReport, ...]
    frames: tuple[FrameRecord, ...] = ()
    daylight: tuple[FrameRecord, ...] = ()
    glow: tuple[GlowPhotograph, ...] = ()
    camera: CameraResponse | None = None
    charge_durations_s: tuple[float, ...] = ()
    background: Region | None = None
    states: int | None = None
