"""Interface of a camera for a responder: a table of operations, and events."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from .vocabulary import Operation

#: Operations of the responder itself, for every camera.
SESSION_OPERATIONS = (
    Operation.GET_DEVICE_INFO,
    Operation.OPEN_SESSION,
    Operation.CLOSE_SESSION,
)


class Response(NamedTuple):
    """Answer to one operation: code, parameters, and the data phase if there is one."""

    code: int
    params: tuple[int, ...] = ()
    data: bytes | None = None


class Event(NamedTuple):
    """Event that a camera sends by itself."""

    code: int
    params: tuple[int, ...] = ()


@dataclass(frozen=True)
class Handler:
    """One operation of the table.

    Attributes
    ----------
    run
        Function that is called with the parameters, and last with the data if the host sends some.
    required, most
        Least and largest number of parameters.
    takes_data
        Whether the host sends a data phase.
    """

    run: Callable[..., Response]
    required: int = 0
    most: int = 0
    takes_data: bool = False


def only_code(run: Callable[..., int]) -> Callable[..., Response]:
    """Return a handler's `run` for an answer that is only a code."""

    def answer(*arguments: object) -> Response:
        return Response(run(*arguments))

    return answer


class Operations(Protocol):
    """One kind of camera as PTP sees it; outlives sessions."""

    @property
    def model(self) -> str:
        """Name of the camera's model."""

    @property
    def table(self) -> Mapping[int, Handler]:
        """Operations inside a session, beside the session's own."""

    @property
    def is_exposing(self) -> bool:
        """Whether the shutter is open."""

    def device_info(self) -> Response:
        """Return DeviceInfo."""

    def is_too_busy_for(self, opcode: int) -> bool:
        """Return whether this operation has to wait for the end of an exposure."""

    def forget_host(self) -> None:
        """End the session."""

    def event_due_s(self) -> float:
        """Return the time of the next event."""

    def take_event(self) -> Event:
        """Return the event that is due; each is reported once."""
