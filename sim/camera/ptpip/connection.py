"""One TCP connection of the PTP/IP server: packets in, packets out, never waiting for either."""

import socket
from collections import deque

from .packets import Packet, PacketReader

_MOST_AT_ONCE = 65536


class Connection:
    """A connection that somebody made to the server.

    Parameters
    ----------
    accepted
        The socket, of which this object takes care.
    """

    def __init__(self, accepted: socket.socket) -> None:
        accepted.setblocking(False)
        # a response is one small packet that somebody waits for
        accepted.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket = accepted
        self._reader = PacketReader()
        self._outgoing: deque[memoryview] = deque()
        self._head_is_cut = False

    def fileno(self) -> int:
        """For `select`."""
        return self._socket.fileno()

    @property
    def is_sending(self) -> bool:
        """Whether packets still wait to be sent."""
        return bool(self._outgoing)

    def receive(self) -> bool:
        """Take in what is there; False if the other side is gone."""
        try:
            received = self._socket.recv(_MOST_AT_ONCE)
        except BlockingIOError:
            return True
        except OSError:
            return False
        self._reader.feed(received)
        return bool(received)

    def next_packet(self) -> Packet | None:
        """The next packet that is there in full.

        Raises
        ------
        MalformedPacketError
            What came is no packet.
        """
        return self._reader.next_packet()

    def put(self, packets: list[bytes]) -> None:
        """Send these packets after those that still wait."""
        self._outgoing.extend(memoryview(packet) for packet in packets)

    def put_instead(self, packets: list[bytes]) -> None:
        """Send these packets instead of those that still wait; one that is half sent is ended."""
        half_sent = [self._outgoing[0]] if self._head_is_cut else []
        self._outgoing = deque(half_sent)
        self.put(packets)

    def send(self) -> bool:
        """Send what the other side takes now; False if it is gone."""
        try:
            while self._outgoing:
                head = self._outgoing[0]
                sent = self._socket.send(head)
                self._head_is_cut = sent < len(head)
                if self._head_is_cut:
                    self._outgoing[0] = head[sent:]
                else:
                    self._outgoing.popleft()
        except BlockingIOError:
            return True
        except OSError:
            return False
        return True

    def close(self) -> None:
        """Hang up."""
        self._socket.close()
