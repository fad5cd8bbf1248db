"""A camera on a simulated cable: the parts put together."""

from labrig.clock import VirtualClock

from .body_settings import BodySettings
from .cable import Cable
from .faults import CameraFaults
from .power import AutoPowerOff
from .responder import Responder
from .sensor import Sensor
from .shutter import Shutter
from .still_image import StillImageFunction
from .usb_backend import CameraBackend

_NO_FAULTS = CameraFaults()
_WELL_SET = BodySettings()


class SimulatedCamera:
    """A Canon EOS 5D Mark II whose sensor stands in a simulated room.

    Its state lives as long as this object: a second connection finds the session that the first
    one left open.

    Parameters
    ----------
    clock
        The room's clock; every transfer lets some of its time pass.
    sensor
        Makes the RAW files, which are DNG.
    serial
        Serial number in PTP's DeviceInfo; over USB an EOS camera tells none.
    seed
        Of the shutter's jitter.
    shutter_lag_s, shutter_jitter_s
        Mean and standard deviation of the time from a full press to the open shutter.
    faults
        What goes wrong.
    body
        What somebody has set by hand.
    """

    def __init__(
        self,
        clock: VirtualClock,
        sensor: Sensor,
        *,
        serial: str,
        seed: int,
        shutter_lag_s: float = 0.063,
        shutter_jitter_s: float = 0.002,
        faults: CameraFaults = _NO_FAULTS,
        body: BodySettings = _WELL_SET,
    ) -> None:
        shutter = Shutter(clock, shutter_lag_s, shutter_jitter_s, seed)
        self._responder = Responder(clock, sensor, shutter, serial, faults, body)
        power = AutoPowerOff(clock, body.auto_power_off_s)
        function = StillImageFunction(clock, self._responder, faults)
        self._backend = CameraBackend(clock, function, Cable(clock, faults, power))

    @property
    def backend(self) -> CameraBackend:
        """For `usb.core.find(backend=...)`."""
        return self._backend

    @property
    def responder(self) -> Responder:
        """The camera itself, for another transport."""
        return self._responder

    def lose_host(self) -> None:
        """The program that uses the camera is killed: the system closes its connections.

        The camera is not told, so its session stays open.
        """
        self._backend.close_all()
