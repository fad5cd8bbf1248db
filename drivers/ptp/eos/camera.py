"""A Canon EOS, remotely controlled, which delivers its RAW frames to the PC only."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace

from labrig.acquire import CameraCapabilities, ExposureSettings, Finding, Frame
from labrig.foundation.clock import Clock

from ..device_info import DeviceInfo
from ..failures import RefusedError
from ..session import SHORT_TIMEOUTS, Session
from ..settings import PtpCameraSettings
from .checks import findings
from .exposure import EosExposure
from .frames import EosFrames, EosTransfer
from .protocol import (
    FEW_SHOTS,
    HOST_ROOM,
    RAW_ONLY,
    SINGLE_SHOT,
    TO_HOST,
    Eos,
    Property,
    number,
)
from .shutter import EosShutter
from .state import EosState
from .viewfinder import EosViewfinder


class EosCamera:
    """A Canon EOS in an open session.

    The button is held half pressed from `arm` on, so that `shoot` costs one short transaction
    before the shutter moves. A frame whose `shoot` was broken off is discarded before the next.
    Exposures longer than the dial's are at bulb, and their actual times are the measured ones.

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
        self._armed = False
        self._state = EosState(session, clock, settings.answer_timeout, info.operations)
        transfer = EosTransfer(session, clock, info)
        self._frames = EosFrames(self._state, transfer, clock, settings.transfer_timeout)
        self._shutter = EosShutter(session, clock, info, self._frames, settings.shutter_lag)
        self._exposure = EosExposure(
            self._state,
            settings,
            settings.native_isos(info.model).values,
            has_bulb=self._shutter.has_bulb,
        )
        self._viewfinder = EosViewfinder(session, self._state, clock, info)

    def take_control(self) -> None:
        """Set remote mode, single shots, RAW frames to the PC.

        Raises
        ------
        DeviceError
            The camera did not take one of these settings.
        """
        self._session.transact(Eos.SetRemoteMode, 1)
        self._session.transact(Eos.SetEventMode, 1)
        self._state.refresh()
        if self._state.value(Property.drive_mode) is not None:
            self._state.set(Property.drive_mode, number(SINGLE_SHOT))
        self._state.set(Property.image_format, RAW_ONLY)
        self._state.set(Property.destination, number(TO_HOST))
        self._send_if_known(Eos.PCHDDCapacity, *HOST_ROOM)
        self._state.refresh()

    def take_over(self) -> None:
        """Take control, and release a button or a shutter that another program may have held.

        Raises
        ------
        DeviceError
            The camera did not take one of the settings.
        """
        self.take_control()
        self._shutter.force_release()
        self._frames.expect_left_over()

    def give_back(self) -> None:
        """End remote mode.

        Raises
        ------
        DeviceError
            The camera does not answer.
        """
        for step in (Eos.SetEventMode, Eos.SetRemoteMode):
            with suppress(RefusedError):
                self._session.transact(step, 0, timeouts=SHORT_TIMEOUTS)

    def capabilities(self) -> CameraCapabilities:
        """Return the exposure settings that the camera offers now.

        Raises
        ------
        DeviceError
            The camera offers no settings that the rig file allows, for example because its dial is
            not at M.
        """
        self._state.refresh()
        return self._exposure.capabilities()

    def findings(self) -> Sequence[Finding]:
        """Return findings on dial, lens switch and menus.

        Raises
        ------
        DeviceError
            The camera does not answer.
        """
        self._state.refresh()
        return findings(self._state, self._settings, self._info, has_bulb=self._shutter.has_bulb)

    def keep_awake(self) -> None:
        """Postpone the camera's automatic switching-off.

        Raises
        ------
        DeviceError
            The camera is gone.
        """
        # one that refuses is awake, too
        with suppress(RefusedError):
            self._send_if_known(Eos.KeepDeviceOn)

    def configure(self, settings: ExposureSettings) -> ExposureSettings:
        """Set and read back; return the settings in force, with the actual shutter time.

        Parameters
        ----------
        settings
            Exposure settings; the shutter time as offered, or as on the dial (1/60 s for the actual
            1/64 s). At bulb the actual time is known after the exposure only: see the frame's.

        Raises
        ------
        DeviceError
            The camera does not offer the settings or did not take them.
        """
        self._armed = False
        self._shutter.release()
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
        self._shutter.get_ready(at_bulb=self._exposure.at_bulb)
        self._armed = True

    def shoot(self) -> Frame:
        """Release now, wait for the exposure, transfer the frame.

        Raises
        ------
        DeviceError
            The camera did not release, or delivered no frame or another one.
        """
        self.arm()
        self._armed = False
        settings = self._exposure.in_force()
        if self._exposure.at_bulb:
            start_s, end_s = self._shutter.expose_at_bulb(settings.exposure_s)
            settings = replace(settings, exposure_s=end_s - start_s)
        else:
            start_s, end_s = self._shutter.expose(settings.exposure_s)
        data, suffix = self._frames.fetch()
        self._shutter.release()
        return Frame(data, suffix, start_s, end_s, settings)

    def preview(self) -> bytes:
        """Return one picture of the viewfinder, a JPEG; the first call starts it.

        Raises
        ------
        DeviceError
            The camera has no live view, does not start it, or sends no picture.
        """
        self._armed = False
        return self._viewfinder.picture()

    def steps_to_safety(self) -> Sequence[Callable[[], None]]:
        """Return the steps: shutter closed at bulb, button up, viewfinder off, nothing pending.

        Another exposure that has begun runs to its end in the camera; frames are discarded later.
        """
        self._armed = False
        return (
            self._shutter.close,
            self._shutter.release,
            self._frames.discard_offered,
            self._viewfinder.off_whoever_switched_it_on,
        )

    def _send_if_known(self, operation: Eos, *params: int) -> None:
        if operation in self._info.operations:
            self._session.transact(operation, *params)
