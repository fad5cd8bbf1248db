"""One TCP connection of the PTP/IP server: packets in, packets out, never waiting for either."""

import socket
from collections import deque

from .packets import Packet, PacketReader

_MAX_AT_ONCE = 65536


class Connection:
    """A connection that a host made to the server.

    Parameters
    ----------
    accepted
        Accepted socket, which this object owns.
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
        """Return the socket's file descriptor, for `select`."""
        return self._socket.fileno()

    @property
    def is_sending(self) -> bool:
        """Whether packets still wait to be sent."""
        return bool(self._outgoing)

    def receive(self) -> bool:
        """Take in the bytes that have come; return False if the other side is gone."""
        try:
            received = self._socket.recv(_MAX_AT_ONCE)
        except BlockingIOError:
            return True
        except OSError:
            return False
        self._reader.feed(received)
        return bool(received)

    def next_packet(self) -> Packet | None:
        """Return the next complete packet.

        Raises
        ------
        MalformedPacketError
            The bytes are no packet.
        """
        return self._reader.next_packet()

    def put(self, packets: list[bytes]) -> None:
        """Queue these packets after those that still wait."""
        self._outgoing.extend(memoryview(packet) for packet in packets)

    def put_instead(self, packets: list[bytes]) -> None:
        """Queue these packets in place of waiting ones; one that is half sent is completed."""
        half_sent = [self._outgoing[0]] if self._head_is_cut else []
        self._outgoing = deque(half_sent)
        self.put(packets)

    def send(self) -> bool:
        """Send as much as the other side takes now; return False if it is gone."""
        try:
            while self._outgoing:
                head = self._outgoing[0]
                sent_bytes = self._socket.send(head)
                self._head_is_cut = sent_bytes < len(head)
                if self._head_is_cut:
                    self._outgoing[0] = head[sent_bytes:]
                else:
                    self._outgoing.popleft()
        except BlockingIOError:
            return True
        except OSError:
            return False
        return True

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()
