"""What a responder needs of a camera: a table of operations, and events that it sends by itself."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from .vocabulary import Operation

#: Obeyed by the responder itself, for every camera.
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
    """What a camera says without being asked."""

    code: int
    params: tuple[int, ...] = ()


@dataclass(frozen=True)
class Handler:
    """One operation of the table.

    Attributes
    ----------
    run
        Called with the parameters, and last with the data if the host sends some.
    required, most
        How many parameters there must be, how many there may be.
    takes_data
        Whether the host sends a data phase.
    """

    run: Callable[..., Response]
    required: int = 0
    most: int = 0
    takes_data: bool = False


def only_code(run: Callable[..., int]) -> Callable[..., Response]:
    """A handler's `run` for what answers nothing but a code."""

    def answer(*arguments: object) -> Response:
        return Response(run(*arguments))

    return answer


class Operations(Protocol):
    """One kind of camera as PTP sees it; outlives sessions."""

    @property
    def model(self) -> str:
        """Its name."""

    @property
    def table(self) -> Mapping[int, Handler]:
        """What it obeys in a session, beside the session's own operations."""

    @property
    def is_exposing(self) -> bool:
        """Whether the shutter is open."""

    def device_info(self) -> Response:
        """GetDeviceInfo."""

    def is_too_busy_for(self, opcode: int) -> bool:
        """Whether this operation has to wait for the end of an exposure."""

    def forget_host(self) -> None:
        """The session is over."""

    def event_due_s(self) -> float:
        """When it will next say something by itself."""

    def take_event(self) -> Event:
        """What that is; said once."""
