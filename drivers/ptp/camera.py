"""A Canon EOS on USB or in the network as labrig's camera."""

from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress

from labrig.acquire.connections import Connections
from labrig.acquire.findings import Finding
from labrig.acquire.values import CameraOffers, ExposureSettings, Frame
from labrig.errors import DeviceError

from .device_info import DeviceInfo, parse_device_info
from .eos_checks import findings
from .eos_exposure import EosExposure
from .eos_frames import EosFrames
from .eos_protocol import (
    FEW_SHOTS,
    HOST_ROOM,
    RAW_ONLY,
    SINGLE_SHOT,
    TO_HOST,
    Eos,
    Property,
    lacking_operations,
    number,
)
from .eos_release import LATE_PRESS_S, release_of
from .eos_state import EosState
from .eos_transfer import EosTransfer
from .eos_viewfinder import EosViewfinder
from .failures import RefusedError
from .link import open_link
from .ptp_codes import Standard
from .session import CURT, Session
from .settings import PtpCameraSettings


class PtpCamera:
    """A Canon EOS, remotely controlled, which delivers its RAW frames to the PC only.

    The button is held half pressed from `arm` on, so that `shoot` costs one short transaction
    before the shutter moves. A frame whose `shoot` was broken off is discarded before the next.

    Parameters
    ----------
    address
        `usb://vid:pid[/serial]`, `ptpip://host[:port]` or `sim://room/device`.
    settings
        The rig file's keys for this camera.
    connections
        Opens the USB device or the network connection; has the clock.

    Raises
    ------
    DeviceError
        No camera there, in use by another program, or not a remotely controllable EOS.
    """

    Settings = PtpCameraSettings

    def __init__(self, address: str, settings: PtpCameraSettings, connections: Connections) -> None:
        self._settings = settings
        self._clock = connections.clock
        self._armed = False
        with ExitStack() as undo:
            self._link = open_link(address, connections)
            undo.callback(self._link.close)
            self._session = Session(self._link, self._clock)
            self._state = EosState(self._session, self._clock, settings.answer_timeout)
            self._exposure = EosExposure(self._state, settings)
            left_behind = self._open_session()
            undo.callback(self._take_leave)
            self._info = self._ask_identity(address)
            self._release = release_of(self._info, self._session)
            transfer = EosTransfer(self._session, self._clock, self._info)
            timeout_s = settings.transfer_timeout
            self._viewfinder = EosViewfinder(self._session, self._state, self._clock, self._info)
            self._frames = EosFrames(self._state, transfer, self._clock, timeout_s)
            self._take_control()
            if left_behind:
                self._release.let_go_blindly()
            undo.pop_all()

    @classmethod
    def declared_offers(cls, settings: PtpCameraSettings) -> CameraOffers:
        """What planning without the camera assumes."""
        return settings.declared_offers()

    def identity(self) -> str:
        """Model, serial number and firmware, as the camera gave them."""
        return str(self._info)

    def offers(self) -> CameraOffers:
        """What it can be set to, as it is now.

        Raises
        ------
        DeviceError
            Nothing that the rig file allows, for example because its dial is not at M.
        """
        self._state.refresh()
        return self._exposure.offers()

    def findings(self) -> Sequence[Finding]:
        """How its dial, lens switch and menus are set.

        Raises
        ------
        DeviceError
            The camera does not answer.
        """
        self._state.refresh()
        return findings(self._state, self._settings.isos, self._info.operations)

    def keep_awake(self) -> None:
        """Put off its automatic switching-off.

        Raises
        ------
        DeviceError
            The camera is gone.
        """
        # one that refuses is awake, too
        with suppress(RefusedError):
            self._send_if_known(Eos.KeepDeviceOn)

    def configure(self, settings: ExposureSettings) -> ExposureSettings:
        """Set and read back; returns the settings in force, with the true shutter time.

        Parameters
        ----------
        settings
            The shutter time as offered, or as on the dial (1/60 s for the true 1/64 s).

        Raises
        ------
        DeviceError
            The camera does not offer them or did not take them.
        """
        self._armed = False
        self._release.let_go_half(self._busy_s())
        self._frames.discard_abandoned()
        self._exposure.apply(settings)
        return self._exposure.in_force()

    def arm(self) -> None:
        """Press half and hold; may take seconds where the lens focuses.

        Raises
        ------
        DeviceError
            The camera does not get ready.
        """
        if self._armed:
            return
        self._viewfinder.off()
        self._frames.discard_abandoned()
        shots = self._state.value(Property.shots_left)
        if shots is not None and shots < FEW_SHOTS:
            self._send_if_known(Eos.PCHDDCapacity, *HOST_ROOM)
        self._send_if_known(Eos.KeepDeviceOn)
        self._release.press_half()
        self._armed = True

    def shoot(self) -> Frame:
        """Release now, wait for the exposure, transfer the frame.

        The exposure begins in the middle of the release command's round trip, give or take half of
        it, plus the measured `shutter_lag`.

        Raises
        ------
        DeviceError
            The camera did not release, or delivered no or another frame.
        """
        self.arm()
        self._armed = False
        settings = self._exposure.in_force()
        start_s = self._press(settings.exposure_s)
        end_s = start_s + settings.exposure_s
        self._frames.expect(end_s)
        self._release.let_go_full(self._busy_s())
        self._clock.sleep_until(end_s)
        data, suffix = self._frames.fetch()
        self._release.let_go_half(LATE_PRESS_S)
        return Frame(data, suffix, start_s, end_s, settings)

    def preview(self) -> bytes:
        """One picture of the viewfinder, a JPEG; the first one starts it, `make_safe` stops it.

        Raises
        ------
        DeviceError
            The camera has no live view, does not start it, or sends no picture.
        """
        self._armed = False
        return self._viewfinder.picture()

    def make_safe(self) -> None:
        """Bring the line back into step, let go of the button, viewfinder off, nothing pending.

        An exposure that has begun runs to its end in the camera; its frame is discarded later.

        Raises
        ------
        DeviceError
            One of these could not be confirmed; all of them were tried.
        """
        self._armed = False
        steps: tuple[Callable[[], None], ...] = (
            self._back_in_step,
            lambda: self._release.let_go_full(self._busy_s()),
            lambda: self._release.let_go_half(self._busy_s()),
            self._frames.discard_offered,
            self._viewfinder.off_whoever_switched_it_on,
        )
        problems: list[str] = []
        with self._clock.shielded():
            for step in steps:
                try:
                    step()
                except DeviceError as problem:
                    problems.append(str(problem))
        if problems:
            raise DeviceError("camera not known to be safe: " + "; ".join(dict.fromkeys(problems)))

    def disconnect(self) -> None:
        """Give the camera back to its own buttons and release it; never raises."""
        with self._clock.shielded():
            try:
                self._take_leave()
            finally:
                self._link.close()

    def _open_session(self) -> bool:
        """Open the session, through a reset if need be; True if a dead program left one behind."""
        try:
            return self._session.open()
        except DeviceError:
            self._session.start_over()
            return True

    def _ask_identity(self, address: str) -> DeviceInfo:
        info = parse_device_info(self._session.transact(Standard.GetDeviceInfo).data)
        if lacking := lacking_operations(info.operations):
            raise DeviceError(
                f"camera {address}: expected a Canon EOS with remote release, got {info} without "
                f"{', '.join(lacking)}: set its USB mode to PC remote, or use a camera that has it"
            )
        return info

    def _take_control(self) -> None:
        self._session.transact(Eos.SetRemoteMode, 1)
        self._session.transact(Eos.SetEventMode, 1)
        self._state.refresh()
        if self._state.value(Property.drive_mode) is not None:
            self._state.set(Property.drive_mode, number(SINGLE_SHOT))
        self._state.set(Property.image_format, RAW_ONLY)
        self._state.set(Property.destination, number(TO_HOST))
        self._send_if_known(Eos.PCHDDCapacity, *HOST_ROOM)
        self._state.refresh()

    def _take_leave(self) -> None:
        with suppress(DeviceError):
            for step in (Eos.SetEventMode, Eos.SetRemoteMode):
                with suppress(RefusedError):
                    self._session.transact(step, 0, patience=CURT)
            self._session.close()

    def _send_if_known(self, operation: Eos, *params: int) -> None:
        if operation in self._info.operations:
            self._session.transact(operation, *params)

    def _press(self, exposure_s: float) -> float:
        """Clock time at which the exposure began."""
        # should it be broken off, nobody knows whether it has begun: assume so
        self._frames.expect(self._clock.now() + LATE_PRESS_S + exposure_s)
        try:
            reply = self._release.press_full(exposure_s)
        except RefusedError:
            self._frames.expect_none()
            raise
        return (reply.sent_s + reply.answered_s) / 2 + self._settings.shutter_lag

    def _back_in_step(self) -> None:
        try:
            self._session.resynchronise()
        except DeviceError:
            self._session.start_over()
            self._take_control()
            self._release.let_go_blindly()

    def _busy_s(self) -> float:
        """How long the camera may be busy: to the end of an exposure, and a little more."""
        return self._frames.exposing_for_s() + LATE_PRESS_S
