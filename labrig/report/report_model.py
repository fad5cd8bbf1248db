"""What a report shows of a decay, gathered from its result and its run."""

from dataclasses import dataclass

from labrig.optics import CameraResponse
from labrig.record import FrameRecord, RunDescription
from labrig.region import Region
from labrig.results import FittedDecay, NoiseBudget, Series

#: What every decay measured with a camera rests on.
DECAY_ASSUMPTIONS = (
    "The amplitudes aᵢ are what the decay measures: the signal at lamp off in the brightest "
    "channel, extrapolated. They are products aᵢ = Λᵢ kᵢ rᵢ(0) with the rate kᵢ; re-radiance Λᵢ "
    "and charge level rᵢ(0) are not determined separately by a decay alone.",
    "A frame measures the mean over its exposure, and is fitted as such.",
    "Rates and amplitudes are shared by the channels; each channel has one weight. So every state "
    "is taken to have the same colour.",
    "Signals are relative: DN/s of this camera at the ISO speed and aperture listed below, not an "
    "absolute radiance.",
    "Uncertainties are standard uncertainties (1 σ) from photon, read and dark noise and, where it "
    "was fitted, the flicker that all channels of a frame share. They do not cover a wrong model, "
    "temperature or stray light.",
)


@dataclass(frozen=True)
class GlowPhotograph:
    """A frame of the glow that is worth showing.

    Parameters
    ----------
    frame
        The frame, its file readable.
    t_s
        Start of the exposure after lamp off.
    """

    frame: FrameRecord
    t_s: float


@dataclass(frozen=True)
class PatchReport:
    """One patch of the sample.

    Parameters
    ----------
    name
        As in the protocol.
    region
        Where it lies in the photographs; None if not known.
    series
        What was measured there, DN/s.
    fit
        The fit, or the reason why there is none.
    noise
        Where σ comes from; None where that is not told.
    """

    name: str
    region: Region | None
    series: Series
    fit: FittedDecay | str
    noise: NoiseBudget | None = None


@dataclass(frozen=True)
class DecayReport:
    """One decay.

    Parameters
    ----------
    about
        The run.
    patches
        One or more.
    frames
        All of them; those of the role `decay` tell the timing.
    daylight
        Photographs under the lamp, of different exposures: the best exposed one is shown.
    glow
        Photographs of the glow by rising time, six or so, all of one decay.
    camera
        Sensitivity of the camera, for colours; None if not known.
    charges_s
        How long the lamp shone before each decay, as measured.
    background
        The region whose level was subtracted from each frame; None if dark frames served for that.
    states
        The number of states asked for; None if the data decided.
    """

    about: RunDescription
    patches: tuple[PatchReport, ...]
    frames: tuple[FrameRecord, ...] = ()
    daylight: tuple[FrameRecord, ...] = ()
    glow: tuple[GlowPhotograph, ...] = ()
    camera: CameraResponse | None = None
    charges_s: tuple[float, ...] = ()
    background: Region | None = None
    states: int | None = None
