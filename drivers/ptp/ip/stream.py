"""One TCP connection to a camera: packets out, packets in, and what went wrong in one line."""

import socket

from ..failures import UnpluggedError
from .packets import Packet, split

WRITE_TIMEOUT_S = 5.0
BLOCK_BYTES = 1024 * 1024

LOOK_AT_NETWORK = "check that it is on, in the network, and free of other programs"


class PacketStream:
    """Packets over one socket, of which this object takes care.

    Parameters
    ----------
    connected
        The socket.
    name
        What messages call it.
    """

    def __init__(self, connected: socket.socket, name: str) -> None:
        connected.settimeout(WRITE_TIMEOUT_S)  # reads come when there is something to read
        self._socket = connected
        self._name = name
        self._received = bytearray()
        self._gone: str | None = None

    def fileno(self) -> int:
        """For `select`."""
        return self._socket.fileno()

    @property
    def beginning(self) -> bytes:
        """What has come of a packet that is not all there."""
        return bytes(self._received)

    def write(self, packets: bytes, doing: str) -> None:
        """Send all of it.

        Raises
        ------
        UnpluggedError
            The camera does not take it, or is gone; `doing` says what for.
        """
        self.check(doing)
        try:
            self._socket.sendall(packets)
        except OSError as failure:
            self._gone = str(failure)  # half a packet may be out: nothing can follow it
            self.check(doing)

    def take_in(self) -> None:
        """Receive what is there; should the camera be gone, what came before stays to be read."""
        try:
            received = self._socket.recv(BLOCK_BYTES)
        except OSError as failure:
            self._gone = str(failure)
            return
        if not received:
            self._gone = "it has hung up"
        self._received += received

    def check(self, doing: str) -> None:
        """Nothing, if the camera is still there.

        Raises
        ------
        UnpluggedError
            It is gone.
        """
        if self._gone is not None:
            raise UnpluggedError(
                f"{self._name}: {doing}: it is gone ({self._gone}): {LOOK_AT_NETWORK}"
            )

    def next_packet(self, at_most_bytes: int) -> Packet | None:
        """The next packet, if all of it has been taken in.

        Raises
        ------
        MalformedError
            What came is no packet, and nothing behind it can be understood any more.
        """
        return split(self._received, at_most_bytes)

    def close(self) -> None:
        """Hang up."""
        self._socket.close()
