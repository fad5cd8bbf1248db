"""A camera behind libgphoto2 as labrig's camera."""

from collections.abc import Sequence
from contextlib import ExitStack

from labrig.acquire import CameraCapabilities, Connections, ExposureSettings, Finding, Frame
from labrig.foundation.errors import DeviceError, DeviceLostError

from .checks import findings
from .exposure import Exposure
from .failures import BusyError, PerhapsReleasedError
from .frames import Frames
from .labels import labelled_times_s
from .library import POLL_PERIOD_S, Library, port_path
from .preparation import prepare
from .process import require_gphoto2
from .release import Release, release_of
from .settings import Gphoto2CameraSettings

#: Setting that ends the live view, on Canon and Nikon only; elsewhere it ends with the next frame.
VIEWFINDER = "viewfinder"
#: Time for which a busy full press is repeated; a frame any later belongs to no decay.
LATE_PRESS_S = 3.0
#: Number of uncertain releases that are repeated; their frames, if any, are passed over.
_UNSURE_TRIES = 3


class Gphoto2Camera:
    """Any camera that libgphoto2 can set and release.

    Parameters
    ----------
    address
        Address of the camera, `usb://vid:pid[/serial]` or `ptpip://host[:port]`.
    settings
        The rig file's keys for this camera.
    connections
        Connections that find the USB device or dial the network, and have the clock.

    Raises
    ------
    UsageError
        The extra is not installed, or the rig is simulated.
    DeviceError
        No camera is at the address, another program uses it, or it cannot be set to RAW.
    """

    Settings = Gphoto2CameraSettings

    _release: Release
    _exposure: Exposure

    def __init__(
        self, address: str, settings: Gphoto2CameraSettings, connections: Connections
    ) -> None:
        require_gphoto2()
        self._clock = connections.clock
        self._settings = settings
        self._library = Library(self._clock, port_path(address, connections), address)
        self._frames = Frames(self._library, self._clock, settings.transfer_timeout)
        self._armed: ExposureSettings | None = None
        self._is_viewing = False
        with ExitStack() as leaving:
            leaving.callback(self._library.close)
            self._take_control()
            self._version = self._library.version()
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
            Times in seconds by a dial in thirds and in halves of a stop.
        """
        return labelled_times_s(label_s)

    def identity(self) -> str:
        """Return maker, model, serial number, firmware and driver of the camera."""
        setting_at_connect = self._library.at_connect
        maker, model = self._maker(), setting_at_connect("cameramodel") or "camera"
        is_named_twice = maker != "" and maker.split()[0] in model
        parts = [
            model if is_named_twice else f"{maker} {model}".strip(),
            f"serial {setting_at_connect('serialnumber') or 'unknown'}",
            f"firmware {setting_at_connect('deviceversion') or 'unknown'}",
            f"released by libgphoto2 {self._version}, {self._release.description}",
        ]
        return ", ".join(parts)

    def capabilities(self) -> CameraCapabilities:
        """Return the exposure settings that the camera offers now.

        Raises
        ------
        DeviceError
            The camera offers no settings that the rig file allows, for example because its dial is
            not at M.
        """
        return self._exposure.capabilities()

    def findings(self) -> Sequence[Finding]:
        """Return findings on the camera's settings, as far as libgphoto2 reports them.

        Raises
        ------
        DeviceError
            The camera does not answer.
        """
        return findings(self._library, self._release, self._maker())

    def keep_awake(self) -> None:
        """Poll for events, by which libgphoto2 keeps a camera on.

        Raises
        ------
        DeviceError
            The camera is gone.
        """
        self._frames.discard_reported()

    def configure(self, settings: ExposureSettings) -> ExposureSettings:
        """Set and read back; return the settings in force, with the actual shutter time.

        Parameters
        ----------
        settings
            Exposure settings; the shutter time as offered, or as on the dial (1/60 s for the actual
            1/64 s).

        Raises
        ------
        DeviceError
            The camera does not offer the settings or did not take them.
        """
        self._disarm()
        self._frames.discard_abandoned()
        self._exposure.apply(settings)
        return self._exposure.in_force()

    def arm(self) -> None:
        """Do all that can be done before the release.

        Raises
        ------
        DeviceError
            The camera does not get ready.
        """
        if self._armed is not None:
            return
        self._viewfinder_off()
        self._frames.discard_abandoned()
        in_force = self._exposure.in_force()
        self._release.get_ready()
        self._armed = in_force

    def shoot(self) -> Frame:
        """Release now, wait for the exposure, transfer the frame.

        The exposure begins in the middle of the time in which the camera may have obeyed, plus the
        measured `shutter_lag`.

        Raises
        ------
        DeviceError
            The camera did not release, or delivered no frame or another one.
        """
        self.arm()
        settings, self._armed = self._armed, None
        assert settings is not None
        start_s = self._press(settings.exposure_s)
        end_s = start_s + settings.exposure_s
        self._frames.expect(end_s)
        self._release.release_full(self._busy_s())
        self._clock.sleep_until(end_s)
        data, suffix = self._frames.fetch()
        self._release.release(LATE_PRESS_S)
        return Frame(data, suffix, start_s, end_s, settings)

    def preview(self) -> bytes:
        """Return a live view picture, a JPEG; the first call starts it, `make_safe` stops it.

        Raises
        ------
        DeviceError
            The camera has no live view, or sends no picture.
        """
        self._disarm()
        self._is_viewing = True
        return self._library.preview()

    def make_safe(self) -> None:
        """Resynchronise libgphoto2, release the button, stop live view, leave nothing pending.

        An exposure that has begun runs to its end in the camera; its frame is passed over later.

        Raises
        ------
        DeviceLostError
            The camera is gone.
        DeviceError
            One of these steps could not be confirmed; the others were tried.
        """
        problems: list[DeviceError] = []
        with self._clock.shielded():
            for step in (
                self._back_in_step,
                self._disarm,
                self._viewfinder_off,
                self._frames.discard_reported,
            ):
                try:
                    step()
                except DeviceLostError as problem:
                    problems.append(problem)
                    break
                except DeviceError as problem:
                    problems.append(problem)
        if problems:
            is_lost = any(isinstance(problem, DeviceLostError) for problem in problems)
            messages = "; ".join(dict.fromkeys(map(str, problems)))
            kind = DeviceLostError if is_lost else DeviceError
            raise kind(f"camera not known to be safe: {messages}")

    def disconnect(self) -> None:
        """Give the camera back to its own buttons and release it; never raises."""
        with self._clock.shielded():
            self._leaving.close()

    def _take_control(self) -> None:
        """Connect and apply the settings that control by a PC needs, whatever the state before."""
        self._library.connect()
        self._armed = None
        self._is_viewing = False
        self._release = release_of(
            self._library, self._clock, self._maker(), self._settings.release
        )
        self._exposure = Exposure(self._library, self._settings)
        prepare(self._library, self._settings.answer_timeout)

    def _back_in_step(self) -> None:
        if not self._library.settle():
            self._take_control()

    def _disarm(self) -> None:
        self._armed = None
        self._release.release(self._busy_s())

    def _viewfinder_off(self) -> None:
        if self._is_viewing and self._library.has(VIEWFINDER):
            self._library.set(VIEWFINDER, "0")
        self._is_viewing = False

    def _press(self, exposure_s: float) -> float:
        """Release the shutter and return the clock time at which the exposure began."""
        deadline_s = self._clock.now() + LATE_PRESS_S
        tries_left = _UNSURE_TRIES
        while True:
            # should it be broken off, nobody knows whether it has begun: assume so
            self._frames.expect(self._clock.now() + LATE_PRESS_S + exposure_s)
            try:
                obeyed = self._release.press(exposure_s)
            except BusyError:
                self._frames.expect_none()
                if self._clock.now() >= deadline_s:
                    raise
                self._clock.sleep(POLL_PERIOD_S)
            except PerhapsReleasedError:
                tries_left -= 1
                if not tries_left:
                    raise
                self._frames.discard_abandoned()
            else:
                return (obeyed.begin_s + obeyed.end_s) / 2 + self._settings.shutter_lag

    def _busy_s(self) -> float:
        """Return how long the camera may be busy: to the end of an exposure, and a little more."""
        return self._frames.exposing_for_s() + LATE_PRESS_S

    def _maker(self) -> str:
        return self._library.at_connect("manufacturer") or ""
