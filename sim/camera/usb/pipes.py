"""An IN endpoint: containers on their way to the host, counted packet by packet."""

from collections import deque

from ... import usb_errors


class InPipe:
    """Containers that wait to be read.

    A transfer ends with a packet shorter than the endpoint's, which is an empty one when a
    container fills its last packet. Bytes are copied in one piece; only the arithmetic is done
    in packets.

    Parameters
    ----------
    packet_size
        The endpoint's wMaxPacketSize.
    """

    def __init__(self, packet_size: int) -> None:
        self._packet_size = packet_size
        self._transfers: deque[memoryview] = deque()

    def __bool__(self) -> bool:
        return bool(self._transfers)

    def put(self, container: bytes) -> None:
        """Queue one container."""
        self._transfers.append(memoryview(container))

    def discard(self) -> None:
        """Discard everything that was not read."""
        self._transfers.clear()

    def take(self, room: int) -> memoryview:
        """Return what a read of `room` bytes receives of the first container."""
        transfer = self._transfers.popleft()
        whole_packets = room // self._packet_size * self._packet_size
        if room >= len(transfer):
            # A read that is filled exactly ends without seeing the empty packet behind it.
            if len(transfer) and room == len(transfer) and room == whole_packets:
                self._transfers.appendleft(memoryview(b""))
            return transfer
        if room == 0 or room != whole_packets:
            # The packet that did not fit has been acknowledged: it is lost.
            lost = whole_packets + self._packet_size
            if lost <= len(transfer):
                self._transfers.appendleft(transfer[lost:])
            raise usb_errors.overflowed()
        self._transfers.appendleft(transfer[room:])
        return transfer[:room]
