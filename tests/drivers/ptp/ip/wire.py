"""A camera on the network that says what it was told to say, whatever it hears."""

import socket
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress

from labrig.drivers.ptp.ip.link import IpLink
from labrig.drivers.ptp.ip.packets import PacketKind, encode
from labrig.foundation.clock import SystemClock

ADDRESS = "ptpip://camera"
ACK = encode(PacketKind.INIT_COMMAND_ACK, (1).to_bytes(4, "little") + bytes(16) + bytes(6))
EVENT_ACK = encode(PacketKind.INIT_EVENT_ACK)


class Saying:
    """Dials: the first connection gets `command`, the second `event`, further ones nothing."""

    def __init__(self, command: bytes, event: bytes) -> None:
        self._to_say = [command, event]
        self._open = ExitStack()
        self.ends: list[socket.socket] = []

    def dial(self) -> socket.socket:
        ours, theirs = socket.socketpair()
        self._open.enter_context(ours)
        self._open.enter_context(theirs)
        theirs.settimeout(5.0)
        said = self._to_say.pop(0) if self._to_say else b""
        theirs.sendall(said)
        self.ends.append(theirs)
        return ours

    def link(self) -> IpLink:
        return IpLink(self.dial, ADDRESS, SystemClock())

    def heard(self) -> list[bytes]:
        """What the PC has said since the last time, by connection."""
        said = []
        for end in self.ends:
            end.setblocking(False)
            pieces = []
            with suppress(BlockingIOError):
                while piece := end.recv(1 << 20):
                    pieces.append(piece)
            said.append(b"".join(pieces))
        return said

    def hang_up(self) -> None:
        """Say nothing more."""
        for end in self.ends:
            end.shutdown(socket.SHUT_WR)

    def close(self) -> None:
        self._open.close()


@contextmanager
def saying(command: bytes = b"", event: bytes = b"", *, ack: bytes = ACK) -> Iterator[Saying]:
    """A camera that lets the PC in, then says this on its two connections."""
    camera = Saying(ack + command, EVENT_ACK + event)
    try:
        yield camera
    finally:
        camera.close()
