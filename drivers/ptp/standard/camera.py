"""A PTP camera without a maker's extension: what PIMA 15740 itself offers, and no more."""

from collections.abc import Callable, Sequence

from labrig.acquire import CameraOffers, ExposureSettings, Finding, Frame
from labrig.clock import Clock
from labrig.errors import DeviceError

from ..codes import Standard, StandardProperty
from ..device_info import DeviceInfo
from ..failures import RefusedError
from ..opening import identify
from ..session import Reply, Session, Timeouts
from ..settings import PtpCameraSettings
from .checks import MANUAL_PROGRAM, findings, prepare
from .exposure import StandardExposure
from .frames import StandardFrames
from .properties import StandardProperties

#: A frame later than so much belongs to no decay.
LATE_RELEASE_S = 3.0
#: A lens that focuses keeps a camera from answering.
FOCUS_S = 12.0
#: An answer later than this and than the exposure's end comes when the shutter has closed.
PROMPT_S = 0.25

NEEDED = frozenset(
    {
        Standard.InitiateCapture,
        Standard.GetObjectInfo,
        Standard.GetObject,
        Standard.GetDevicePropDesc,
        Standard.GetDevicePropValue,
        Standard.SetDevicePropValue,
    }
)


class StandardCamera:
    """Any camera that releases by InitiateCapture, in an open session.

    Its frames go to its own card; each is deleted there when the next one is prepared. A frame
    whose `shoot` was broken off is discarded before the next.

    Parameters
    ----------
    session
        Over which it is spoken to.
    clock
        On which it is waited for.
    info
        What it says about itself.
    settings
        The rig file's keys for this camera.
    """

    def __init__(
        self, session: Session, clock: Clock, info: DeviceInfo, settings: PtpCameraSettings
    ) -> None:
        self._session = session
        self._clock = clock
        self._info = info
        self._settings = settings
        self._in_force: ExposureSettings | None = None
        self._properties = StandardProperties(
            session, clock, info.properties, settings.answer_timeout
        )
        native = settings.native_isos(info.model).values
        self._exposure = StandardExposure(self._properties, settings, native)
        self._frames = StandardFrames(session, clock, info, settings.transfer_timeout)

    def take_control(self) -> None:
        """Manual exposure, manual focus, single shots, as far as the camera lets them be set.

        Raises
        ------
        DeviceError
            The camera does not answer.
        """
        self._frames.discard_reported()
        prepare(self._properties)

    def take_over(self) -> None:
        """As `take_control`: nothing is held that somebody could have left behind."""
        self.take_control()

    def give_back(self) -> None:
        """Nothing: the camera was never kept from its own buttons."""

    def offers(self) -> CameraOffers:
        """What it can be set to, as it is now.

        Raises
        ------
        DeviceError
            Nothing that the rig file allows, or it does not tell.
        """
        self._require_manual()
        return self._exposure.offers()

    def findings(self) -> Sequence[Finding]:
        """How it is set, as far as the standard lets it tell.

        Raises
        ------
        DeviceError
            The camera does not answer.
        """
        return findings(self._properties, identify(self._session), self._settings)

    def keep_awake(self) -> None:
        """Speak to it, which is all that the standard has.

        Raises
        ------
        DeviceError
            The camera is gone.
        """
        identify(self._session)

    def configure(self, settings: ExposureSettings) -> ExposureSettings:
        """Set and read back; returns the settings in force, with the shutter time as told.

        Parameters
        ----------
        settings
            The shutter time as offered, or another within a tenth of a stop of it.

        Raises
        ------
        DeviceError
            The camera does not offer them or did not take them.
        """
        self._in_force = None
        self._frames.discard_abandoned()
        self._require_manual()
        self._exposure.apply(settings)
        return self._exposure.in_force()

    def arm(self) -> None:
        """Clear the card of earlier frames, read the settings in force.

        Raises
        ------
        DeviceError
            The camera does not answer, or stands at something that cannot be reduced.
        """
        self._armed_with()

    def shoot(self) -> Frame:
        """Release now, wait for the exposure, transfer the frame.

        The exposure begins within the round trip of InitiateCapture, in its middle as far as is
        known, plus the measured `shutter_lag`; the standard offers nothing better.

        Raises
        ------
        DeviceError
            The camera did not release, or delivered no RAW frame.
        """
        settings = self._armed_with()
        self._in_force = None
        start_s = self._release(settings.exposure_s)
        end_s = start_s + settings.exposure_s
        self._frames.expect(end_s)
        data, suffix = self._frames.fetch()
        return Frame(data, suffix, start_s, end_s, settings)

    def preview(self) -> bytes:
        """No picture: the standard has no live view.

        Raises
        ------
        DeviceError
            Always.
        """
        raise DeviceError(
            f"expected a camera with live view, {self._info} has none that the PTP standard "
            "knows: aim through its own viewfinder"
        )

    def steps_to_safety(self) -> Sequence[Callable[[], None]]:
        """Nothing pending; no button is ever held.

        An exposure that has begun runs to its end in the camera; its frame is discarded later.
        """
        self._in_force = None
        return (self._frames.discard_reported,)

    def _armed_with(self) -> ExposureSettings:
        if self._in_force is None:
            self._frames.discard_abandoned()
            self._require_manual()
            self._in_force = self._exposure.in_force()
        return self._in_force

    def _release(self, exposure_s: float) -> float:
        """Clock time at which the exposure began."""
        # should it be broken off, nobody knows whether it has begun: assume so
        self._frames.expect(self._clock.now() + LATE_RELEASE_S + exposure_s)
        timeouts = Timeouts(answer_s=exposure_s + FOCUS_S, busy_s=LATE_RELEASE_S)
        try:
            reply = self._session.transact(Standard.InitiateCapture, 0, 0, timeouts=timeouts)
        except RefusedError:
            self._frames.expect_none()
            raise
        return _begun_s(reply, exposure_s) + self._settings.shutter_lag

    def _require_manual(self) -> None:
        program = self._properties.describe(StandardProperty.exposure_program)
        if program is not None and program.value != MANUAL_PROGRAM:
            raise DeviceError(
                f"expected manual exposure, the camera says {program.value} for its "
                f"{StandardProperty.exposure_program}: turn its dial to M"
            )


def _begun_s(reply: Reply, exposure_s: float) -> float:
    """Middle of the time in which an exposure can have begun.

    By the standard a camera answers when it has begun; some answer when it is over.
    """
    round_trip_s = reply.answered_s - reply.sent_s
    latest_s = reply.answered_s
    if round_trip_s > max(exposure_s, PROMPT_S):
        latest_s -= exposure_s
    return (reply.sent_s + latest_s) / 2
