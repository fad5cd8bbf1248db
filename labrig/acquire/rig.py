"""The devices of one bench, open, with the clock they share."""

from collections.abc import Iterable, Mapping
from typing import cast

from labrig.acquire.roles import (
    SAFE_ORDER,
    Camera,
    Device,
    Hands,
    Lamp,
    LampShield,
    Thermometer,
    TrapDoor,
)
from labrig.clock import Clock
from labrig.errors import DeviceError, DeviceLostError, LabrigError, ProtocolError


class Rig:
    """Open devices by their key in the rig file.

    Parameters
    ----------
    name
        As in the rig file.
    clock
        The clock all devices wait on.
    devices
        Key → open device, each filling the role its key names.
    warm_up_s
        Key → seconds the device needs from switching on until it is steady.
    """

    def __init__(
        self,
        name: str,
        clock: Clock,
        devices: Mapping[str, Device],
        warm_up_s: Mapping[str, float],
    ) -> None:
        self.name = name
        self.clock = clock
        self.devices = dict(devices)
        self._warm_up_s = dict(warm_up_s)
        self.connected_s = clock.now()

    @property
    def lamp(self) -> Lamp:
        """The lamp; `ProtocolError` where the rig has none."""
        return cast(Lamp, self._device("lamp"))

    @property
    def camera(self) -> Camera:
        """The camera; `ProtocolError` where the rig has none."""
        return cast(Camera, self._device("camera"))

    @property
    def door(self) -> TrapDoor:
        """The trap door; `ProtocolError` where the rig has none."""
        return cast(TrapDoor, self._device("door"))

    @property
    def shield(self) -> LampShield:
        """The lamp's shield; `ProtocolError` where the rig has none."""
        return cast(LampShield, self._device("shield"))

    @property
    def hands(self) -> Hands:
        """What works in a person's place; `ProtocolError` where the rig has none."""
        return cast(Hands, self._device("hands"))

    @property
    def thermometer(self) -> Thermometer:
        """The thermometer; `ProtocolError` where the rig has none."""
        return cast(Thermometer, self._device("thermometer"))

    def warm_up_s(self, key: str) -> float:
        """Seconds that device needs to become steady; 0 where the rig file says nothing."""
        return self._warm_up_s.get(key, 0.0)

    def identities(self) -> dict[str, str]:
        """Key → what each device says it is."""
        return {key: device.identity() for key, device in self.devices.items()}

    def make_safe(self) -> None:
        """Lamp off, LEDs off, door closed: every device is tried, whatever the others answered.

        Lights first: a door that closes turns its sample to the lamp.

        Raises
        ------
        DeviceError
            Some device could not confirm its safe state; names all of them.
        DeviceLostError
            All of those are gone, and may come back.
        """
        failures, gone = {}, True
        with self.clock.shielded():
            for key in in_safe_order(self.devices):
                try:
                    self.devices[key].make_safe()
                except Exception as error:
                    said = str(error) if isinstance(error, LabrigError) else repr(error)
                    failures[key] = f"{key}: {said}"
                    gone = gone and isinstance(error, DeviceLostError)
        if failures:
            refusal = (DeviceLostError if gone else DeviceError)(
                "the safe state is not confirmed; switch off by hand: "
                + "; ".join(failures.values())
            )
            refusal.unsafe = tuple(failures)
            raise refusal

    def disconnect(self) -> None:
        """Release every device."""
        with self.clock.shielded():
            for device in self.devices.values():
                device.disconnect()

    def _device(self, key: str) -> Device:
        if key not in self.devices:
            raise ProtocolError(
                f"the protocol needs a {key}, the rig '{self.name}' has none "
                f"(only {', '.join(sorted(self.devices)) or 'nothing'}); add it under 'devices:'"
            )
        return self.devices[key]


def in_safe_order(keys: Iterable[str]) -> list[str]:
    """Keys of devices, those first that have to be safe before the others move."""
    return sorted(keys, key=lambda key: SAFE_ORDER.get(key, len(SAFE_ORDER)))
