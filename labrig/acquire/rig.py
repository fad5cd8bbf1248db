"""The devices of one bench, open, with the clock they share."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, cast

from labrig.acquire.roles import ROLES, Device, Role
from labrig.acquire.roles.role import DeviceT
from labrig.clock import Clock
from labrig.errors import (
    DeviceError,
    DeviceLostError,
    LabrigError,
    ProtocolError,
    UnclearAnswerError,
)

#: For so long a device is told again that does not confirm what it was told.
PATIENCE_S = 30.0
#: Between two rounds of telling: at first, and at most.
FIRST_PAUSE_S, LONGEST_PAUSE_S = 0.1, 2.0


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

    def __getitem__(self, role: Role[DeviceT]) -> DeviceT:
        """The device that fills the role.

        Raises
        ------
        ProtocolError
            The rig has none.
        """
        return cast(DeviceT, self.device(role.key))

    def __contains__(self, role: Role[Any]) -> bool:
        return role.key in self.devices

    def device(self, key: str) -> Device:
        """As by its role."""
        if key not in self.devices:
            raise ProtocolError(
                f"the protocol needs a {ROLES[key].name}, the rig '{self.name}' has none "
                f"(only {', '.join(sorted(self.devices)) or 'nothing'}); add it under 'devices:'"
            )
        return self.devices[key]

    def warm_up_s(self, key: str) -> float:
        """Seconds that device needs to become steady; 0 where the rig file says nothing."""
        return self._warm_up_s.get(key, 0.0)

    def identities(self) -> dict[str, str]:
        """Key → what each device says it is."""
        return {key: device.identity() for key, device in self.devices.items()}

    def connect(self, key: str, open_device: Callable[[], Device]) -> None:
        """Open a device and bring it to its safe state.

        Raises
        ------
        DeviceError
            It cannot be opened, or does not answer clearly for `PATIENCE_S`.
        UsageError
            The rig file asks for something that it is not, or does not know.
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
        """Lights off, door closed: every device is tried, whatever the others answered.

        Lights first: a door that closes turns its sample to the lamp. A device that does not
        confirm is told again, for up to `PATIENCE_S`; one that is gone is not, since only
        connecting again helps.

        Raises
        ------
        DeviceError
            Some device could not confirm its safe state; names all of them.
        DeviceLostError
            All of those are gone or do not answer clearly, and may come back.
        """
        with self.clock.shielded():
            failures = require(
                self.clock,
                {key: self.devices[key].make_safe for key in in_safe_order(self.devices)},
                unless=_is_gone,
            )
        if failures:
            lost = all(isinstance(error, DeviceLostError) for error in failures.values())
            said = [
                f"{key}: {error if isinstance(error, LabrigError) else repr(error)}"
                for key, error in failures.items()
            ]
            refusal = (DeviceLostError if lost else DeviceError)(
                f"the safe state is not confirmed; switch off by hand: {'; '.join(said)}"
            )
            refusal.unsafe = tuple(failures)
            raise refusal

    def disconnect(self) -> None:
        """Release every device."""
        with self.clock.shielded():
            for device in self.devices.values():
                device.disconnect()


@contextmanager
def device_errors(key: str) -> Iterator[None]:
    """Whatever a driver raises, its own faults included, names the device and ends the run."""
    try:
        yield
    except LabrigError:
        raise
    except Exception as error:
        raise DeviceError(f"{key}: its driver failed ({error!r})") from error


def require(
    clock: Clock,
    steps: Mapping[str, Callable[[], None]],
    unless: Callable[[Exception], bool],
) -> dict[str, Exception]:
    """Go round until every step has succeeded once, for up to `PATIENCE_S`; what failed to the end.

    No step waits for another one's patience to be over.

    Parameters
    ----------
    steps
        Key → what is to be done, in this order in every round.
    unless
        Whether after this failure there is no use in trying that step again.
    """
    failures: dict[str, Exception] = {}
    left = dict(steps)
    deadline_s, pause_s = clock.now() + PATIENCE_S, FIRST_PAUSE_S
    while True:
        for key, step in list(left.items()):
            try:
                step()
            except Exception as error:
                failures[key] = error
                if unless(error):
                    del left[key]
            else:
                failures.pop(key, None)
                del left[key]
        if not left or clock.now() >= deadline_s:
            return failures
        clock.sleep(pause_s)
        pause_s = min(2 * pause_s, LONGEST_PAUSE_S)


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
        The same keys; devices without a prescribed place come last, in the order given.

    Examples
    --------
    >>> from labrig.acquire import in_safe_order
    >>> in_safe_order(["camera", "door", "lamp"])
    ['lamp', 'door', 'camera']
    """
    order = [key for key, role in ROLES.items() if role.safe_first]
    return sorted(keys, key=lambda key: order.index(key) if key in order else len(order))
