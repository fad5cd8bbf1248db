r"""A changer that obeys lines of text: a home-made sample changer or filter wheel.

Any microcontroller will do: it reads `fresh sample\n` or `filter 37\n`, moves, and answers `done\n`
or `cannot`, the reason and `\n`. The simulated room's changer uses the same lines.
"""

from pydantic import Field

from labrig.acquire import Connections
from labrig.foundation.errors import DeviceError, UnclearAnswerError
from labrig.foundation.models import FrozenModel
from labrig.foundation.quantity import DurationS

from .serial_line import SerialLine

BAUDRATE = 115_200


class TextChanger:
    """A changer on a serial line.

    Parameters
    ----------
    address
        Serial port of the changer.
    settings
        The rig file's keys for this device.
    connections
        Connections that open the port.
    """

    class Settings(FrozenModel):
        """Keys of a changer that obeys lines of text in a rig file.

        Attributes
        ----------
        baud
            Baud rate of the serial line; USB boards ignore it.
        takes_at_most
            Time within which the changer must have answered `done`, for example `2 min`.
        """

        baud: int = Field(BAUDRATE, gt=0)
        takes_at_most: DurationS = 120.0

    def __init__(self, address: str, settings: Settings, connections: Connections) -> None:
        self._settings = settings
        self._name = f"the changer at {address}"
        port = connections.serial(address, settings.baud)
        self._line = SerialLine(port, connections.clock, self._name)

    def identity(self) -> str:
        """Return the changer's address: it reports no identity."""
        return self._name.removeprefix("the ")

    def do(self, task: str) -> None:
        """Have the changer do a task; return when it has answered `done`.

        Raises
        ------
        DeviceError
            The changer cannot do the task.
        UnclearAnswerError
            The changer gives another answer, or none.
        """
        self._line.write(task.encode() + b"\n")
        line = self._line.read_until(b"\n", self._settings.takes_at_most)
        answer = " ".join(line.decode(errors="replace").split())
        if answer != "done":
            kind = DeviceError if answer.startswith("cannot") else UnclearAnswerError
            raise kind(
                f"{self._name} was sent '{task}': expected 'done', got '{answer}'; do it by hand, "
                "without 'changer:' in the rig file, or teach them"
            )

    def make_safe(self) -> None:
        """End a half-written line and discard old answers; a moving changer finishes its task."""
        self._line.write(b"\n")
        self._line.drain()

    def disconnect(self) -> None:
        """Do nothing: the port belongs to the connections, which close it."""
