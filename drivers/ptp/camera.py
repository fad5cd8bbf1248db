"""A PTP camera on USB as labrig's camera."""

from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from typing import Protocol

from labrig.acquire import CameraCapabilities, Connections, ExposureSettings, Finding, Frame
from labrig.foundation.errors import DeviceError, DeviceLostError

from .eos.codes import labelled_times_s as eos_times_s
from .eos.protocol import lacking_operations
from .opening import identify, open_link, open_session
from .session import Session
from .settings import PtpCameraSettings
from .standard.exposure import labelled_times_s as standard_times_s


class Body(Protocol):
    """One kind of camera; methods that are not described here are those of the roles."""

    def take_control(self) -> None:
        """Apply the settings that control by a PC needs, and read them back."""

    def take_over(self) -> None:
        """Take control where a dead program, or a reset, left the camera in an unknown state."""

    def give_back(self) -> None:
        """Give the camera back to its own buttons."""

    def capabilities(self) -> CameraCapabilities:
        """Return the exposure settings that the camera offers now."""

    def findings(self) -> Sequence[Finding]:
        """Return findings on the camera's manual settings, as far as it reports them."""

    def keep_awake(self) -> None:
        """Postpone the camera's automatic switching-off."""

    def configure(self, settings: ExposureSettings) -> ExposureSettings:
        """Apply exposure settings and read them back."""

    def arm(self) -> None:
        """Do all that can be done before the release."""

    def shoot(self) -> Frame:
        """Release now, wait for the exposure, transfer the frame."""

    def preview(self) -> bytes:
        """Return one live picture, a JPEG."""

    def steps_to_safety(self) -> Sequence[Callable[[], None]]:
        """Return the steps that make the camera safe, all of which are tried in this order."""


class PtpCamera:
    """A camera in a PTP session, and the kind of body that it reports.

    Parameters
    ----------
    address
        Address of the camera, `usb://vid:pid[/serial]` or `sim://room/device`.
    settings
        The rig file's keys for this camera.
    connections
        Connections that open the USB device, and have the clock.

    Raises
    ------
    DeviceError
        No camera is at the address, another program uses it, or it has no remote control.
    """

    Settings = PtpCameraSettings

    def __init__(self, address: str, settings: PtpCameraSettings, connections: Connections) -> None:
        self._clock = connections.clock
        with ExitStack() as leaving:
            link = open_link(address, connections)
            leaving.callback(link.close)
            self._session = Session(link, self._clock)
            is_stale = open_session(self._session)
            leaving.callback(self._close_session)
            self._info = identify(self._session)
            self._body = self._body_for(address, settings)
            leaving.callback(self._give_back)
            if is_stale:
                self._body.take_over()
            else:
                self._body.take_control()
            self._in_control = True
            self._leaving = leaving.pop_all()

    @classmethod
    def recorded_exposures_s(cls, label_s: float, identity: str) -> tuple[float, ...]:
        """Return the exposure times that a run may hold for a frame with a time in its EXIF.

        Parameters
        ----------
        label_s
            Exposure time in the frame's EXIF in seconds.
        identity
            What the camera said of itself.

        Returns
        -------
        tuple of float
            Times in seconds, one for each way in which such a camera may count, always in the same
            order; empty if the PC ends the exposure.
        """
        if "EOS" in identity:
            return eos_times_s(label_s)
        # Some cameras of other names are set by Canon's codes, too.
        return (*(eos_times_s(label_s) or (label_s, label_s)), *standard_times_s(label_s))

    def identity(self) -> str:
        """Return model, serial number and firmware that the camera reported."""
        return str(self._info)

    def capabilities(self) -> CameraCapabilities:
        """Return the exposure settings that the camera offers now.

        Raises
        ------
        DeviceError
            The camera offers no settings that the rig file allows, for example because its dial is
            not at M.
        """
        return self._body.capabilities()

    def findings(self) -> Sequence[Finding]:
        """Return findings on dial, lens switch and menus, as far as the camera reports them.

        Raises
        ------
        DeviceError
            The camera does not answer.
        """
        return self._body.findings()

    def keep_awake(self) -> None:
        """Postpone the camera's automatic switching-off.

        Raises
        ------
        DeviceError
            The camera is gone.
        """
        self._body.keep_awake()

    def configure(self, settings: ExposureSettings) -> ExposureSettings:
        """Set and read back; return the settings in force, with the actual shutter time.

        Raises
        ------
        DeviceError
            The camera does not offer the settings or did not take them.
        """
        return self._body.configure(settings)

    def arm(self) -> None:
        """Do all that can be done before the release.

        Raises
        ------
        DeviceError
            The camera does not get ready.
        """
        self._body.arm()

    def shoot(self) -> Frame:
        """Release now, wait for the exposure, transfer the frame.

        Raises
        ------
        DeviceError
            The camera did not release, or delivered no frame or another one.
        """
        return self._body.shoot()

    def preview(self) -> bytes:
        """Return a viewfinder picture, a JPEG; the first call starts it, `make_safe` stops it.

        Raises
        ------
        DeviceError
            The camera has no live view, does not start it, or sends no picture.
        """
        return self._body.preview()

    def make_safe(self) -> None:
        """Resynchronise the line, release the button, stop the viewfinder, leave nothing pending.

        Raises
        ------
        DeviceLostError
            The camera is gone.
        DeviceError
            One of these steps could not be confirmed; all of them were tried.
        """
        problems: list[DeviceError] = []
        with self._clock.shielded():
            for step in (self._back_in_step, *self._body.steps_to_safety()):
                try:
                    step()
                except DeviceError as problem:
                    problems.append(problem)
        if problems:
            self._in_control = False
            is_lost = any(isinstance(problem, DeviceLostError) for problem in problems)
            messages = "; ".join(dict.fromkeys(map(str, problems)))
            kind = DeviceLostError if is_lost else DeviceError
            raise kind(f"camera not known to be safe: {messages}")

    def disconnect(self) -> None:
        """Give the camera back to its own buttons and release it; never raises."""
        with self._clock.shielded():
            self._leaving.close()

    def _body_for(self, address: str, settings: PtpCameraSettings) -> Body:
        operations = self._info.operations
        if not (lacking := lacking_operations(operations)):
            from .eos.camera import EosCamera  # a bench has a camera of one kind

            return EosCamera(self._session, self._clock, self._info, settings)
        from .standard.camera import StandardCamera, missing_operations

        if not (missing := missing_operations(operations)):
            return StandardCamera(self._session, self._clock, self._info, settings)
        raise DeviceError(
            f"camera {address}: expected a Canon EOS with remote release or a camera with "
            f"InitiateCapture, got {self._info} without {', '.join(lacking)}, and without "
            f"{', '.join(missing)}: set its USB mode to PC remote, or use a camera that has them"
        )

    def _give_back(self) -> None:
        with suppress(DeviceError):
            self._body.give_back()

    def _close_session(self) -> None:
        with suppress(DeviceError):
            self._session.close()

    def _back_in_step(self) -> None:
        """Cancel a transaction that was broken off; where cancelling fails, start over."""
        if self._in_control:
            try:
                self._session.resynchronise()
            except DeviceError:
                self._in_control = False
            else:
                return
        self._session.start_over()
        self._body.take_over()
        self._in_control = True
