"""One camera as libgphoto2 shows it: named settings with labels for values, events, files."""

from typing import Any, NamedTuple
from urllib.parse import urlsplit

import usb.util

from labrig.acquire import Connections
from labrig.foundation.clock import Clock, VirtualClock
from labrig.foundation.errors import DeviceError, UsageError

from .failures import UnspecifiedError
from .process import HelperProcess

#: Some cameras on the network ask their owner first.
CONNECT_S = 30.0
#: libgphoto2's own time-out for a transaction is 20 s.
USUAL_S = 25.0
#: A slow lens keeps a 5D Mark II from answering for 8 s (libgphoto2).
RELEASE_S = 12.0
#: Longest wait for a pending request before the safe state.
SETTLE_S = 3.0
#: Interval between two attempts while the camera is not ready.
POLL_PERIOD_S = 0.01
#: Time in which only waiting events are reported.
AT_ONCE_S = 0.02


class Span(NamedTuple):
    """Two clock times, in seconds, between which an event happened."""

    begin_s: float
    end_s: float


class Setting(NamedTuple):
    """Label of a setting's value, and the labels of its choices; none if it is not a choice."""

    value: str
    choices: tuple[str, ...]


#: IANA's port for PTP/IP.
PTPIP_PORT = 15740


def port_path(address: str, connections: Connections) -> str:
    """Return libgphoto2's name of the port at `usb://vid:pid[/serial]` or `ptpip://host[:port]`.

    The address is held for this labrig; a camera on the network is dialled once and hung up, since
    libgphoto2 takes numbers only and is slow to report that no camera answers.

    Raises
    ------
    UsageError
        The address is of another kind, or the rig is simulated.
    DeviceError
        No camera is at the address.
    """
    scheme = urlsplit(address).scheme
    if scheme == "sim" or isinstance(connections.clock, VirtualClock):
        raise UsageError(
            f"{address}: gphoto2_camera works in real time, a simulated rig does not: use "
            "ptp_camera there, or 'labrig sim camera' and the address that it prints"
        )
    if scheme == "ptpip":
        return "ptpip:{0}:{1}:{1}".format(*_peer(address, connections))
    device = connections.usb(address)
    usb.util.dispose_resources(device)
    return f"usb:{device.bus:03d},{device.address:03d}"


def _peer(address: str, connections: Connections) -> tuple[str, int]:
    """Return the IP number and the port of a camera on the network."""
    try:
        with connections.tcp(address, PTPIP_PORT) as dialled:
            host, port = dialled.getpeername()[:2]
    except OSError as error:
        raise DeviceError(
            f"camera {address}: it hung up at once ({error}); switch it off and on"
        ) from None
    if ":" in host:
        raise UsageError(f"{address}: libgphoto2 needs an IPv4 address, this is {host}")
    return host, port


class Library:
    """Connection of libgphoto2 with one camera.

    Parameters
    ----------
    clock
        Clock of the waiting for the camera.
    path
        libgphoto2's name of the port: `usb:001,004`, `ptpip:192.168.1.20`.
    name
        Name of the camera in messages.
    """

    def __init__(self, clock: Clock, path: str, name: str) -> None:
        self._clock = clock
        self._path = path
        self._name = name
        self._process = HelperProcess(clock, name)
        self._values: dict[str, str] = {}

    def connect(self) -> None:
        """Connect, or connect anew.

        Raises
        ------
        DeviceError
            No camera that libgphoto2 supports is there, or another program holds it.
        """
        self._process.start()
        self._values = self._process.ask("connecting", CONNECT_S, "connect", self._path)

    def close(self) -> None:
        """Close the connection with the camera; never raises."""
        self._process.end()

    def settle(self) -> bool:
        """Return whether libgphoto2 is ready for the next request, whatever was interrupted."""
        return self._process.settle(SETTLE_S)

    def version(self) -> str:
        """Return the version of libgphoto2."""
        return str(self._ask("asking for its version", USUAL_S, "version"))

    def at_connect(self, name: str) -> str | None:
        """Return the value of a setting at the connection; None if there is no such setting."""
        return self._values.get(name)

    def has(self, name: str) -> bool:
        """Return whether the camera has a setting of that name."""
        return name in self._values

    def first_of(self, names: tuple[str, ...]) -> str | None:
        """Return the first of `names` that this camera has: names differ from make to make."""
        return next((name for name in names if name in self._values), None)

    def get(self, name: str) -> Setting:
        """Return a setting as it is now.

        Raises
        ------
        DeviceError
            The camera does not answer.
        """
        return Setting(*self._ask(f"reading its {name}", USUAL_S, "get", name))

    def set(self, name: str, value: str, within_s: float = USUAL_S) -> Span:
        """Set a setting without reading back; return the times at which it was sent and answered.

        Raises
        ------
        BusyError
            The camera is busy.
        DeviceError
            The camera does not take the setting.
        """
        doing = f"setting its {name} to {value}"
        return Span(*self._ask(doing, within_s, "set", name, value))

    def set_and_verify(self, name: str, value: str, within_s: float) -> None:
        """Set a setting that has another value, and read back until the camera reports the new one.

        Raises
        ------
        DeviceError
            The camera did not take it within `within_s` seconds.
        """
        if self.get(name).value == value:
            return
        self.set(name, value)
        deadline_s = self._clock.now() + within_s
        while (reported := self.get(name).value) != value:
            if self._clock.now() >= deadline_s:
                raise DeviceError(
                    f"camera {self._name}: asked for {name} {value}, it stays at {reported}: turn "
                    "its dial to M, leave its menus and try again"
                )
            self._clock.sleep(POLL_PERIOD_S)

    def trigger(self, exposure_s: float) -> Span:
        """Photograph; return the times at which libgphoto2 began and ended.

        Raises
        ------
        BusyError
            The camera is busy.
        DeviceError
            The camera does not release.
        """
        within_s = RELEASE_S + exposure_s  # with some it waits for the end of the exposure
        return Span(*self._ask("releasing", within_s, "trigger"))

    def next_file(self, within_s: float, transfer_s: float = USUAL_S) -> tuple[str, str] | None:
        """Return folder and name of the next file; None without one within `within_s` seconds.

        Parameters
        ----------
        transfer_s
            Seconds that the transfer may take of a file that is transferred before it is reported.

        Raises
        ------
        DeviceError
            The camera does not answer.
        """
        file: tuple[str, str] | None = self._ask(
            "waiting for its frame", within_s + transfer_s, "next_file", within_s
        )
        return file

    def read(self, folder: str, name: str, within_s: float) -> bytes:
        """Return the bytes of a file.

        Raises
        ------
        DeviceError
            The file is incomplete.
        """
        return bytes(self._ask(f"transferring {name}", within_s, "read", folder, name))

    def preview(self) -> bytes:
        """Return one picture of the live view, a JPEG.

        Raises
        ------
        DeviceError
            The camera sends no picture.
        """
        return bytes(self._ask("live view", USUAL_S, "preview"))

    def _ask(self, doing: str, within_s: float, request: str, *arguments: Any) -> Any:
        try:
            return self._process.ask(doing, within_s, request, *arguments)
        except UnspecifiedError:
            self._process.ask(doing, USUAL_S, "next_file", 0.0)  # is it still there?
            raise
