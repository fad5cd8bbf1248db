"""Read-back of lights during a run, since another program or person may have switched them."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import cast

from labrig.acquire.rig import Rig, device_errors
from labrig.acquire.roles import DARK, LIGHTS, ROLES, DeviceAction, Light
from labrig.foundation.errors import DeviceError
from labrig.foundation.quantity import duration_text

#: Period of readings during waits; checked every 30 s, it is about a minute.
READ_PERIOD_S = 50.0


def lights_that_read_back(rig: Rig) -> dict[str, bool]:
    """List the lights of a rig with whether their state can be read back.

    Parameters
    ----------
    rig
        Open devices of a bench.

    Returns
    -------
    dict of str to bool
        Whether the state of the light is read from its board, by the light's key in the rig file.

    Examples
    --------
    >>> from pathlib import Path
    >>> import labrig
    >>> from labrig.acquire import lights_that_read_back
    >>> rig_file = labrig.read_rig_file(Path("runs/decay/rig.yaml"))
    >>> with labrig.open_bench(rig_file, "rig.yaml") as bench:
    ...     with bench.devices() as rig:
    ...         print(lights_that_read_back(rig))
    {'lamp': True}
    """
    return {key: light.reads_back() for key, light in _lights(rig)}


class LightReadback:
    """Comparison of the lights' states with those commanded, for boards that read back.

    It reports to the guard of the rig's lights whether one may be on; a light that cannot be read
    back may be on at any time.

    Parameters
    ----------
    rig
        Rig whose lights are safe, and which nothing else switches from now on.
    """

    def __init__(self, rig: Rig) -> None:
        reads_back = lights_that_read_back(rig)
        self._rig = rig
        self._read_back = {key: _LightState(rig, key) for key, reads in reads_back.items() if reads}
        self._all_read_back = all(reads_back.values())
        self._release_if_dark()

    @property
    def is_reported(self) -> bool:
        """Whether any light can be read back."""
        return bool(self._read_back)

    @contextmanager
    def asking(self, action: DeviceAction) -> Iterator[None]:
        """Note an action that is begun within the block."""
        if action.device in LIGHTS:
            self._rig.lights_may_be_on(True)
        yield
        if action.device in self._read_back:
            self._read_back[action.device].asked(str(action))
            self._release_if_dark()

    def _release_if_dark(self) -> None:
        if self._all_read_back and all(light.is_dark for light in self._read_back.values()):
            self._rig.lights_may_be_on(False)

    def read_if_due(self) -> None:
        """Read every light whose last reading is `READ_PERIOD_S` or longer ago.

        Raises
        ------
        DeviceError
            If a light is not in the state commanded.
        """
        for light in self._read_back.values():
            light.read_if_due()

    def read_before(self, actions: Iterable[DeviceAction]) -> None:
        """Read the lights that the given actions will switch.

        A charge that ends now is valid only if nothing else has switched the lamp off before.

        Raises
        ------
        DeviceError
            If a light is not in the state commanded.
        """
        for key in {action.device: None for action in actions}:
            if key in self._read_back:
                self._read_back[key].read()


class _LightState:
    def __init__(self, rig: Rig, key: str) -> None:
        self._rig = rig
        self._role = ROLES[key]
        self._commanded = DARK
        self._commanded_s = self._read_s = rig.clock.now()

    @property
    def is_dark(self) -> bool:
        return self._commanded == DARK

    def asked(self, state: str) -> None:
        self._commanded = state
        self._commanded_s = self._read_s = self._rig.clock.now()

    def read_if_due(self) -> None:
        if self._rig.clock.now() - self._read_s >= READ_PERIOD_S:
            self.read()

    def read(self) -> None:
        assert self._role.state is not None, "it is a light"
        self._read_s = self._rig.clock.now()
        with device_errors(self._role.key):
            state = self._role.state(self._rig[self._role])
        if state == self._commanded:
            return
        raise DeviceError(
            f"the {self._role.name} was switched {self._commanded} "
            f"{duration_text(self._read_s - self._commanded_s)} ago and reads {state}: something "
            "else has switched it (another program on its port, or a hand); leave its board to "
            "labrig while it measures"
        )


def _lights(rig: Rig) -> Iterator[tuple[str, Light]]:
    for key, device in rig.devices.items():
        if key in LIGHTS:
            yield key, cast(Light, device)
