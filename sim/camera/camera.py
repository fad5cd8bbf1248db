"""A camera on a simulated cable, composed of its parts."""

from labrig.foundation.clock import VirtualClock

from .body_settings import BodySettings
from .eos.body import EosBody
from .eos.operations import EosOperations
from .faults import CameraFaults
from .objects import StoredObject
from .operations import Operations
from .photograph import Sensor
from .responder import Responder
from .shutter import Shutter
from .standard.body import StandardBody, StandardHabits
from .standard.operations import StandardOperations
from .usb.backend import CameraBackend
from .usb.cable import AutoPowerOff, Cable
from .usb.descriptors import UsbIdentity
from .usb.still_image import StillImageFunction

_NO_FAULTS = CameraFaults()
_WELL_SET = BodySettings()
_USUAL = StandardHabits()

#: EOS cameras tell their serial number in PTP's DeviceInfo only.
_EOS_ON_USB = UsbIdentity(0x04A9, 0x3199, "Canon Inc.", "Canon Digital Camera")
#: Ids that pid.codes keeps for tests.
_STANDARD_IDS = (0x1209, 0x0001)


class SimulatedCamera:
    """A camera whose sensor stands in a simulated room: a Canon EOS 5D Mark II, or a standard one.

    Its state lives as long as this object: a second connection finds the session that the first one
    left open.

    Parameters
    ----------
    clock
        The room's clock; every transfer takes some of its time.
    sensor
        Sensor that makes the RAW files, which are DNG.
    serial
        Serial number in PTP's DeviceInfo.
    seed
        Seed of the shutter's jitter.
    shutter_lag_s, shutter_jitter_s
        Mean and standard deviation of the time from a full press to the open shutter.
    faults
        Faults of the camera and its cable.
    body
        Kind of the camera, and its manual settings.
    habits
        Peculiarities of the maker of a standard camera.
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
        habits: StandardHabits = _USUAL,
    ) -> None:
        shutter = Shutter(clock, shutter_lag_s, shutter_jitter_s, seed)
        operations: Operations
        if body.body == "eos":
            eos = EosBody(clock, sensor, shutter, faults, body)
            operations, self._objects = EosOperations(eos, serial), eos.objects
            identity = _EOS_ON_USB
        else:
            standard = StandardBody(clock, sensor, shutter, faults, body, habits)
            operations, self._objects = StandardOperations(standard, serial), standard.objects
            identity = UsbIdentity(*_STANDARD_IDS, "labrig", operations.model, serial)
        self._responder = Responder(operations)
        power = AutoPowerOff(clock, body.auto_power_off, lambda: shutter.open_until_s)
        function = StillImageFunction(clock, self._responder, faults)
        self._backend = CameraBackend(clock, function, Cable(clock, faults, power), identity)

    @property
    def backend(self) -> CameraBackend:
        """Backend for `usb.core.find(backend=...)`."""
        return self._backend

    @property
    def responder(self) -> Responder:
        """The camera itself, for another transport."""
        return self._responder

    @property
    def files(self) -> tuple[StoredObject, ...]:
        """Files in the camera now, on cards and in memory."""
        return self._objects.all()

    def lose_host(self) -> None:
        """Kill the program that uses the camera: the system closes its connections.

        The camera does not notice, so its session stays open.
        """
        self._backend.close_all()
