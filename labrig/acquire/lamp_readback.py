"""The lamp read back while it is relied upon: somebody else may have switched it."""

from labrig.acquire.rig import Rig
from labrig.errors import DeviceError
from labrig.quantity import duration_text

#: How often while something is waited for: with looks every 30 s about once a minute.
READ_PERIOD_S = 50.0


class LampReadback:
    """Compares the lamp with what a run has asked of it, where its board tells.

    Parameters
    ----------
    rig
        Whose lamp was made safe, and is switched by nobody else from now on.

    Attributes
    ----------
    is_told
        Whether there is a lamp whose board tells.
    """

    def __init__(self, rig: Rig) -> None:
        self._rig = rig
        self.is_told = "lamp" in rig.devices and rig.lamp.reads_back()
        self._asked_on = False
        self._asked_s = self._read_s = rig.clock.now()

    def asked(self, on: bool) -> None:
        """It was switched just now."""
        self._asked_on = on
        self._asked_s = self._read_s = self._rig.clock.now()

    def read_if_due(self) -> None:
        """Read if the last reading is long ago; as `read`."""
        if self._rig.clock.now() - self._read_s >= READ_PERIOD_S:
            self.read()

    def read(self) -> None:
        """Read now.

        Raises
        ------
        DeviceError
            It is not as it was switched.
        """
        if not self.is_told:
            return
        self._read_s = self._rig.clock.now()
        if self._rig.lamp.is_on() == self._asked_on:
            return
        asked, found = ("on", "off") if self._asked_on else ("off", "on")
        raise DeviceError(
            f"the lamp was switched {asked} {duration_text(self._read_s - self._asked_s)} ago and "
            f"reads {found}: something else has switched it (another program on its port, or a "
            "hand); leave its board to labrig while it measures"
        )
