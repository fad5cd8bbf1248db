"""What a report says, before it is a page."""

from dataclasses import dataclass, field

from labrig.fit import DecayFit
from labrig.optics import CameraResponse
from labrig.record.frames import ActionRecord, FrameRecord
from labrig.region import Region
from labrig.report.sections import Section
from labrig.results import Series

#: What every decay measured with a camera rests on, for `RunReport.assumptions`.
DECAY_ASSUMPTIONS = (
    "The amplitudes aᵢ are what the decay measures: the signal at lamp off in the brightest "
    "channel, extrapolated. They are products aᵢ = Λᵢ kᵢ rᵢ(0) with the rate kᵢ; re-radiance Λᵢ "
    "and concentration rᵢ(0) cannot be told apart by a decay alone.",
    "A frame measures the mean over its exposure, and is fitted as such.",
    "Rates and amplitudes are shared by the channels; each channel has one weight. So every state "
    "is taken to have the same colour.",
    "Signals are relative: DN/s of this camera at the ISO speed and aperture listed below, not an "
    "absolute radiance.",
    "Uncertainties are standard uncertainties (1 σ) from photon, read and dark noise and, where it "
    "was fitted, the flicker that all channels of a frame share. They do not cover a wrong model, "
    "temperature or light that leaks in.",
)


@dataclass(frozen=True)
class DeviceLine:
    """A device of the rig: its role, the address it was reached at, and who answered there."""

    role: str
    address: str
    identity: str


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
class Interruption:
    """An attempt at a unit that did not count: when it began, and why it ended."""

    unit: str
    began: str
    reason: str


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
    """

    name: str
    region: Region | None
    series: Series
    fit: DecayFit | str


@dataclass(frozen=True)
class RunReport:
    """One processed run.

    Parameters
    ----------
    title
        The sample's name, usually.
    run
        Name of the run folder.
    started, ended
        ISO 8601, as they are to be read.
    rig
        Name of the rig.
    simulated
        Whether the rig is a simulated one; the page says so.
    labrig_version, libraries
        Of the processing; libraries by name and version.
    patches
        One or more.
    sample
        Pairs of what and value: thickness, batch, …
    devices, guard, protocol_text, rig_text, frames
        Provenance; `guard` is what would have switched the lights off, had labrig died; the texts
        are YAML. Frames of the purpose `decay` tell the timing.
    warnings
        Shown on top, one line each.
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
    interruptions
        Attempts that failed, by time.
    notes
        What a person had to say afterwards.
    sections
        What else is known of the run, after the timing.
    assumptions
        What the numbers rest on, one sentence or two each.
    actions
        What devices did; lamp, shield and door tell the timing.
    """

    title: str
    run: str
    started: str
    ended: str
    rig: str
    simulated: bool
    labrig_version: str
    patches: tuple[PatchReport, ...]
    sample: tuple[tuple[str, str], ...] = ()
    devices: tuple[DeviceLine, ...] = ()
    guard: str = ""
    protocol_text: str = ""
    rig_text: str = ""
    frames: tuple[FrameRecord, ...] = ()
    warnings: tuple[str, ...] = ()
    daylight: tuple[FrameRecord, ...] = ()
    glow: tuple[GlowPhotograph, ...] = ()
    camera: CameraResponse | None = None
    libraries: tuple[tuple[str, str], ...] = ()
    charges_s: tuple[float, ...] = ()
    background: Region | None = None
    states: int | None = None
    interruptions: tuple[Interruption, ...] = ()
    notes: str = ""
    sections: tuple[Section, ...] = ()
    assumptions: tuple[str, ...] = field(default=DECAY_ASSUMPTIONS)
    actions: tuple[ActionRecord, ...] = ()
