"""A PTP camera without a maker's extension: the abilities of PIMA 15740 itself."""

from collections.abc import Callable, Collection, Sequence
from enum import IntEnum

from labrig.acquire import CameraCapabilities, ExposureSettings, Finding, Frame
from labrig.foundation.clock import Clock
from labrig.foundation.errors import DeviceError

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

#: Longest delay of a frame of a decay.
LATE_RELEASE_S = 3.0
#: Time for which a focusing lens keeps a camera from answering.
FOCUS_S = 12.0
#: An answer later than this and than the exposure's end comes when the shutter has closed.
PROMPT_S = 0.25

#: Operations that release the shutter, each with its parameters; a camera is released by the first
#: one that it has. One of a maker's own is a line here.
RELEASES: tuple[tuple[IntEnum, tuple[int, ...]], ...] = ((Standard.InitiateCapture, (0, 0)),)

_NEEDED = frozenset(
    {
        Standard.GetObjectInfo,
        Standard.GetObject,
        Standard.GetDevicePropDesc,
        Standard.GetDevicePropValue,
        Standard.SetDevicePropValue,
    }
)


def missing_operations(operations: Collection[int]) -> list[str]:
    """Return the operations that a camera lacks for being released by labrig."""
    missing = [f"0x{op:X}" for op in sorted(_NEEDED.difference(operations))]
    if all(release not in operations for release, _ in RELEASES):
        missing.append(" or ".join(f"0x{release:X}" for release, _ in RELEASES))
    return missing


class StandardCamera:
    """Any camera that releases by one of `RELEASES`, in an open session.

    Its frames go to its own card; each is deleted there when the next one is prepared. A frame
    whose `shoot` was broken off is discarded before the next.

    Parameters
    ----------
    session
        Session with the camera.
    clock
        Clock of all waiting.
    info
        Identity and abilities that the camera reports.
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
        self._release_operation, self._release_params = next(
            release for release in RELEASES if release[0] in info.operations
        )
        self._properties = StandardProperties(
            session, clock, info.properties, settings.answer_timeout
        )
        native = settings.native_isos(info.model).values
        self._exposure = StandardExposure(self._properties, settings, native)
        self._frames = StandardFrames(session, clock, info, settings.transfer_timeout)

    def take_control(self) -> None:
        """Set manual exposure, manual focus and single shots, as far as the camera allows it.

        Raises
        ------
        DeviceError
            The camera does not answer.
        """
        self._frames.discard_reported()
        prepare(self._properties)

    def take_over(self) -> None:
        """Take control: another program cannot have left anything held."""
        self.take_control()

    def give_back(self) -> None:
        """Do nothing: the camera's own buttons were never locked."""

    def capabilities(self) -> CameraCapabilities:
        """Return the exposure settings that the camera offers now.

        Raises
        ------
        DeviceError
            The camera offers no settings that the rig file allows, or does not report them.
        """
        self._require_manual()
        return self._exposure.capabilities()

    def findings(self) -> Sequence[Finding]:
        """Return findings on the camera's settings, as far as the standard reports them.

        Raises
        ------
        DeviceError
            The camera does not answer.
        """
        return findings(self._properties, identify(self._session), self._settings)

    def keep_awake(self) -> None:
        """Send a request, the standard's only means to keep a camera awake.

        Raises
        ------
        DeviceError
            The camera is gone.
        """
        identify(self._session)

    def configure(self, settings: ExposureSettings) -> ExposureSettings:
        """Set and read back; return the settings in force, with the nominal shutter time.

        Parameters
        ----------
        settings
            Exposure settings; the shutter time as offered, or another within a tenth of a stop of
            it.

        Raises
        ------
        DeviceError
            The camera does not offer the settings or did not take them.
        """
        self._in_force = None
        self._frames.discard_abandoned()
        self._require_manual()
        self._exposure.apply(settings)
        return self._exposure.in_force()

    def arm(self) -> None:
        """Delete earlier frames from the card, read the settings in force.

        Raises
        ------
        DeviceError
            The camera does not answer, or its settings cannot be reduced.
        """
        self._armed_with()

    def shoot(self) -> Frame:
        """Release now, wait for the exposure, transfer the frame.

        The exposure begins within the round trip of the release, in its middle as far as is
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
        """Raise an error: the standard has no live view.

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
        """Return the steps that leave nothing pending; no button is ever held.

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
        """Release the shutter and return the clock time at which the exposure began."""
        # should it be broken off, nobody knows whether it has begun: assume so
        self._frames.expect(self._clock.now() + LATE_RELEASE_S + exposure_s)
        timeouts = Timeouts(answer_s=exposure_s + FOCUS_S, busy_s=LATE_RELEASE_S)
        try:
            reply = self._session.transact(
                self._release_operation, *self._release_params, timeouts=timeouts
            )
        except RefusedError:
            self._frames.expect_none()
            raise
        return _exposure_begin_s(reply, exposure_s) + self._settings.shutter_lag

    def _require_manual(self) -> None:
        program = self._properties.describe(StandardProperty.exposure_program)
        if program is not None and program.value != MANUAL_PROGRAM:
            raise DeviceError(
                f"expected manual exposure, the camera says {program.value} for its "
                f"{StandardProperty.exposure_program}: turn its dial to M"
            )


def _exposure_begin_s(reply: Reply, exposure_s: float) -> float:
    """Return the middle of the time in which an exposure can have begun.

    By the standard a camera answers when the exposure has begun; some answer when it is over.
    """
    round_trip_s = reply.answered_s - reply.sent_s
    latest_s = reply.answered_s
    if round_trip_s > max(exposure_s, PROMPT_S):
        latest_s -= exposure_s
    return (reply.sent_s + latest_s) / 2
