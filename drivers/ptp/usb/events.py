"""Events on the interrupt endpoint, put together from its packets."""

from ..containers import HEADER_BYTES, Container, Kind, announced_length, decode
from ..failures import MalformedError


class EventAssembler:
    """Takes packet after packet, whether or not the camera ends a container with an empty one."""

    def __init__(self) -> None:
        self._received = bytearray()

    def discard(self) -> None:
        """Forget the beginning of an event that will not be finished."""
        self._received.clear()

    def feed(self, packet: bytes) -> Container | None:
        """The event of which `packet` is the end; None if it is not.

        Raises
        ------
        MalformedError
            What came is no event; it is forgotten.
        """
        self._received += packet
        if len(self._received) < HEADER_BYTES:
            return None
        received = bytes(self._received)
        try:
            length = announced_length(received)
            if len(received) < length:
                return None
            event = decode(received[:length])
            if event.kind is not Kind.EVENT:
                raise MalformedError(
                    "expected an event on the camera's interrupt endpoint", received
                )
        except MalformedError:
            self.discard()
            raise
        self.discard()
        return event
