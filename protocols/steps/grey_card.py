"""A grey card under the steady lamp: placing, lighting and metering it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from labrig.acquire import (
    CAMERA,
    LAMP,
    LAMP_ON,
    CameraCapabilities,
    ExposureSettings,
    Session,
    TakeFrame,
)
from labrig.foundation.detection import DETECTION_SIGMA
from labrig.foundation.errors import DeviceError
from labrig.foundation.quantity import duration_text
from labrig.foundation.region import Region
from labrig.record import FrameRole

from .darkness import range_dn
from .exposure_metering import MeteringFrame, measure_frame
from .sample_pose import face_lamp
from .sanity_checks import SanityChecks

#: Reason for laying the card.
CARD_REASON = (
    "its light is measured next; it lies on the outside of the closed door, without a door "
    "over the sample"
)

#: Shutter times of the metering: one of them is right whatever the lamp.
METERED_S = (1 / 4096, 1 / 512, 1 / 64, 1 / 8, 1.0)
#: Least warm-up time of a lamp that was off.
SETTLES_S = 5.0
#: Brightness of the card that a plan assumes: so dim that exposures are long.
DIM_PER_S = 0.5


#: Fractions of the range that the lit card fills: the reference exposure of brackets, flats,
#: repeats.
HALF = 0.4
DARKS_EACH = 4


@dataclass(frozen=True)
class CardDarkUnit:
    """Dark frames at one ISO, with the card in its place."""

    reference: ExposureSettings
    card: Region
    iso: int
    longest_s: float

    @property
    def name(self) -> str:
        """Name of the unit, for example `dark-iso-100`."""
        return f"dark-iso-{self.iso}"

    def run(self, session: Session) -> None:
        """Photograph at the shortest and the longest exposure, and check that it is dark."""
        session.wait_until_warm("camera")
        capabilities = session.rig[CAMERA].capabilities()
        longest_s = capabilities.exposure_at_most(self.longest_s)
        for exposure_s in (capabilities.exposures_s[0], longest_s):
            shot = ExposureSettings(exposure_s, self.iso, self.reference.f_number)
            for _ in range(DARKS_EACH):
                session.perform(TakeFrame(FrameRole.DARK, shot))
        shorter = [replace(shot, exposure_s=time_s) for time_s in capabilities.exposures_s[:3]]
        SanityChecks(session, self.name, [self.card], None).require_darkness(shorter)


@dataclass(frozen=True)
class CardLight:
    """Rate at which the lit card fills the range from black to white, in its brightest pixels.

    Attributes
    ----------
    per_s
        Fraction of the range per second.
    settings
        Sensitivity and aperture to which `per_s` belongs; the shutter time has no meaning.
    """

    per_s: float
    settings: ExposureSettings

    def __str__(self) -> str:
        return f"fills the range in {duration_text(1 / self.per_s)}"

    def exposure_s(self, fraction: float, settings: ExposureSettings) -> float:
        """Return the shutter time that fills that fraction of the range at an ISO and f-number."""
        gain = settings.iso / self.settings.iso
        if settings.f_number is not None and self.settings.f_number is not None:
            gain *= (self.settings.f_number / settings.f_number) ** 2
        return fraction / (self.per_s * gain)

    def exposed(
        self, fraction: float, settings: ExposureSettings, capabilities: CameraCapabilities
    ) -> ExposureSettings:
        """Return `settings` with the longest offered shutter time within that fraction."""
        exposure_s = capabilities.exposure_at_most(self.exposure_s(fraction, settings))
        return ExposureSettings(exposure_s, settings.iso, settings.f_number)


@dataclass(frozen=True)
class CardMeterUnit:
    """Frames of the lit card at a ladder of shutter times, for `card_light`."""

    settings: ExposureSettings
    card: Region
    name: str = "meter"

    def run(self, session: Session) -> None:
        """Light the card, photograph it, refuse one that is not lit."""
        session.wait_until_warm("camera")
        light_card(session)
        capabilities = session.rig[CAMERA].capabilities()
        for nominal_s in METERED_S:
            exposure_s = capabilities.exposure_at_most(nominal_s)
            shot = ExposureSettings(exposure_s, self.settings.iso, self.settings.f_number)
            session.perform(TakeFrame(FrameRole.METER, shot))
        card_light(session, self.settings, self.card)


def light_card(session: Session) -> None:
    """Switch the lamp on and warm it up, facing the sample, unless it burns already."""
    face_lamp(session)
    if not session.rig[LAMP].is_on():
        session.perform(LAMP_ON)
        session.wait(max(session.rig.warm_up_s("lamp"), SETTLES_S), "lamp warms up")


def card_light(session: Session, settings: ExposureSettings, card: Region) -> CardLight:
    """Return the brightness of the lit card when it was metered.

    Raises
    ------
    DeviceError
        The card is dark, or clips at every shutter time.
    """

    def decide() -> CardLight:
        frames = [measure_frame(frame, [card]) for frame in session.frames(FrameRole.METER)]
        return CardLight(_per_s(frames), settings)

    return session.decide("light of the card", decide, CardLight(DIM_PER_S, settings))


def _per_s(frames: Sequence[MeteringFrame]) -> float:
    """Return the rate from the brightest frame that does not clip."""
    unclipped = []
    for frame in frames:
        card = frame.patches[0]
        if not card.clipped:
            unclipped.append((max(card.channels.values(), key=lambda channel: channel.mean), frame))
    if not unclipped:
        raise DeviceError(
            "the lit card is too bright for the shortest shutter time: lower camera.iso or close "
            "the aperture"
        )
    brightest, frame = max(unclipped, key=lambda pair: pair[0].mean)
    if brightest.mean < DETECTION_SIGMA * brightest.sigma or brightest.mean < 0.001 * range_dn(
        frame
    ):
        raise DeviceError(
            "the card is not lit: check that the lamp is on, the card lies in its place and "
            "'card:' is its region in the frame"
        )
    return brightest.peak / range_dn(frame) / frame.exposure_s
