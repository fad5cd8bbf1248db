"""The open devices of one bench and the clock that they share."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, cast

from labrig.acquire.roles import ROLES, Device, Role
from labrig.acquire.roles.role import DeviceT
from labrig.foundation.clock import Clock
from labrig.foundation.errors import (
    DeviceError,
    DeviceLostError,
    LabrigError,
    MissingDeviceError,
    UnclearAnswerError,
)

#: Time for which a command that a device does not confirm is repeated.
PATIENCE_S = 30.0
#: First and longest pause between two rounds of commands.
FIRST_PAUSE_S, MAX_PAUSE_S = 0.1, 2.0


class Rig:
    """Open devices by their keys in the rig file.

    Parameters
    ----------
    name
        Name of the rig.
    clock
        Clock on which all devices wait.
    devices
        Open devices by key, each with the role of that key.
    warm_up_s
        Warm-up times in seconds from switching on until a device is steady, by key.
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
        #: Called before a light is switched, and after all lights read dark.
        self.lights_may_be_on: Callable[[bool], None] = lambda may_be: None

    def __getitem__(self, role: Role[DeviceT]) -> DeviceT:
        """Return the device with a role.

        Raises
        ------
        MissingDeviceError
            If the rig has no such device.
        """
        return cast(DeviceT, self.device(role.key))

    def __contains__(self, role: Role[Any]) -> bool:
        return role.key in self.devices

    def device(self, key: str) -> Device:
        """Return the device with a key.

        Raises
        ------
        MissingDeviceError
            If the rig has no such device.
        """
        if key not in self.devices:
            raise MissingDeviceError(
                f"the protocol needs a {ROLES[key].name}, the rig '{self.name}' has none "
                f"(only {', '.join(sorted(self.devices)) or 'nothing'}); add '{key}:' under "
                "'devices:'",
                key,
            )
        return self.devices[key]

    def warm_up_s(self, key: str) -> float:
        """Return the warm-up time of a device in seconds; 0 if the rig file gives none."""
        return self._warm_up_s.get(key, 0.0)

    def identities(self) -> dict[str, str]:
        """Return the identity that each device reports, by key."""
        return {key: device.identity() for key, device in self.devices.items()}

    def connect(self, key: str, open_device: Callable[[], Device]) -> None:
        """Open a device and bring it to its safe state.

        Parameters
        ----------
        key
            Key of the device.
        open_device
            Function that opens the device.

        Raises
        ------
        DeviceError
            If the device cannot be opened, or gives no clear answer within `PATIENCE_S`.
        UsageError
            If a setting of the rig file does not fit the device.
        """

        def step() -> None:
            self.devices[key] = open_device()
            self.devices[key].make_safe()

        failures = require(
            self.clock, {key: step}, unless=lambda error: not isinstance(error, UnclearAnswerError)
        )
        if key in failures:
            with device_errors(key):
                raise failures[key]

    def make_safe(self) -> None:
        """Bring every device to its safe state, whatever the others answer.

        Lights come first: a door that closes turns its sample to the lamp. A device that does not
        confirm its state is commanded again for up to `PATIENCE_S`; a device that is gone is not,
        since only connecting again can help.

        Raises
        ------
        DeviceError
            If devices could not confirm their safe state; the message names all of them.
        DeviceLostError
            If all of those are gone or do not answer clearly, and may come back.
        """
        with self.clock.shielded():
            failures = require(
                self.clock,
                {key: self.devices[key].make_safe for key in in_safe_order(self.devices)},
                unless=_is_gone,
            )
        if failures:
            lost = all(isinstance(error, DeviceLostError) for error in failures.values())
            messages = [
                f"{key}: {error if isinstance(error, LabrigError) else repr(error)}"
                for key, error in failures.items()
            ]
            refusal = (DeviceLostError if lost else DeviceError)(
                f"the safe state is not confirmed; switch off by hand: {'; '.join(messages)}"
            )
            refusal.unsafe = tuple(failures)
            raise refusal

    def disconnect(self) -> None:
        """Disconnect every device."""
        with self.clock.shielded():
            for device in self.devices.values():
                device.disconnect()


@contextmanager
def device_errors(key: str) -> Iterator[None]:
    """Turn any exception of a driver but lack of memory, faults included, into a `DeviceError`."""
    try:
        yield
    except (LabrigError, MemoryError):
        raise
    except Exception as error:
        raise DeviceError(f"{key}: its driver failed ({error!r})") from error


def require(
    clock: Clock,
    steps: Mapping[str, Callable[[], None]],
    unless: Callable[[Exception], bool],
) -> dict[str, Exception]:
    """Repeat steps until each has succeeded once, for up to `PATIENCE_S`.

    The steps take turns, so that none waits until the time of another is over.

    Parameters
    ----------
    clock
        Clock on which the pauses are waited.
    steps
        Steps by key, in their order in every round.
    unless
        Whether repeating a step is useless after this failure.

    Returns
    -------
    dict of str to Exception
        Last failures of the steps that did not succeed, by key.
    """
    failures: dict[str, Exception] = {}
    pending = dict(steps)
    deadline_s, pause_s = clock.now() + PATIENCE_S, FIRST_PAUSE_S
    while True:
        for key, step in list(pending.items()):
            try:
                step()
            except Exception as error:
                failures[key] = error
                if unless(error):
                    del pending[key]
            else:
                failures.pop(key, None)
                del pending[key]
        if not pending or clock.now() >= deadline_s:
            return failures
        clock.sleep(pause_s)
        pause_s = min(2 * pause_s, MAX_PAUSE_S)


def _is_gone(error: Exception) -> bool:
    return isinstance(error, DeviceLostError) and not isinstance(error, UnclearAnswerError)


def in_safe_order(keys: Iterable[str]) -> list[str]:
    """Sort devices in the order in which they are made safe.

    Lights come first: a door that closes turns its sample to the lamp.

    Parameters
    ----------
    keys
        Keys of the devices in the rig file.

    Returns
    -------
    list of str
        Keys in that order; devices without a prescribed place come last, as given.

    Examples
    --------
    >>> from labrig.acquire import in_safe_order
    >>> in_safe_order(["camera", "door", "lamp"])
    ['lamp', 'door', 'camera']
    """
    order = [key for key, role in ROLES.items() if role.safe_first]
    return sorted(keys, key=lambda key: order.index(key) if key in order else len(order))
