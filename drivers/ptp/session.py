"""One PTP session: transactions of command, data and response, each answered before the next."""

import logging
import struct
from dataclasses import dataclass
from enum import IntEnum
from typing import Protocol

from labrig.foundation.clock import Clock
from labrig.foundation.errors import DeviceError

from .codes import (
    DEVICE_BUSY,
    OK,
    SESSION_ALREADY_OPEN,
    Standard,
    advice,
    operation_text,
    response_text,
)
from .containers import Container, Kind, command, encode
from .failures import MalformedError, RefusedError

SESSION_ID = 1
LAST_TRANSACTION_ID = 0xFFFFFFFE
#: SessionNotOpen and InvalidTransactionID: no later transaction would fare better.
SESSION_LOST = (0x2003, 0x2004)
#: Left-over containers of earlier transactions that are passed over before giving up.
MAX_STALE = 32
FIRST_BACK_OFF_S = 0.02
MAX_BACK_OFF_S = 0.5
#: More than any answer but a frame: an EOS lists its properties in some 20 kB.
MAX_ANSWER_BYTES = 4 * 1024 * 1024

#: Remedy for a camera that stays busy because it has nowhere to put a frame.
NO_CARD = "no card is in it, and some cameras stay busy without: put one in, and leave its menus"

_logger = logging.getLogger(__name__)


class Link(Protocol):
    """Containers to and from one camera; every failure is a `DeviceError`."""

    def send(self, request: Container, data: bytes | None, doing: str) -> None:
        """Send a command, and its data if it has some; `doing` is its purpose in messages."""

    def receive(self, doing: str, timeout_s: float, at_most_bytes: int) -> Container:
        """Return the next container of limited length, within `timeout_s` for each packet."""

    def event(self, timeout_s: float) -> Container | None:
        """Return the next event, None if the camera reports none within `timeout_s`."""

    def cancel(self, transaction_id: int) -> None:
        """Make the camera cancel a transaction and discard what it still sends."""

    def reset(self) -> None:
        """Reset the camera's PTP side; its session is closed."""

    def close(self) -> None:
        """Close the connection with the camera; never raises."""


@dataclass(frozen=True)
class Timeouts:
    """Longest durations of a transaction.

    Attributes
    ----------
    answer_s
        Seconds until the camera must have answered.
    busy_s
        Seconds for which DeviceBusy is met by asking again; 0 for once only.
    """

    answer_s: float
    busy_s: float


#: Time-outs of an operation that takes no time.
DEFAULT_TIMEOUTS = Timeouts(answer_s=5.0, busy_s=3.0)
#: Time-outs of closing: nothing waits for it.
SHORT_TIMEOUTS = Timeouts(answer_s=2.0, busy_s=0.0)


@dataclass(frozen=True)
class Reply:
    """Answer of the camera, and its time.

    Attributes
    ----------
    params
        Response parameters.
    data
        Data phase; empty where there was none.
    sent_s, answered_s
        Clock times around the attempt that succeeded.
    """

    params: tuple[int, ...]
    data: bytes
    sent_s: float
    answered_s: float


class Session:
    """Transactions over a link.

    A transaction broken off by an error or an interruption stays noted as under way; the next one,
    or `resynchronise`, first makes the camera cancel it. A camera that reports no such session, or
    another count of transactions, gets no request before `start_over`.
    """

    def __init__(self, link: Link, clock: Clock) -> None:
        self._link = link
        self._clock = clock
        self._next_id = 0
        self._under_way: int | None = None
        self._lost_by: int | None = None
        self._logged: tuple[IntEnum, tuple[int, ...], int, int] | None = None

    def open(self) -> bool:
        """Open the session; return whether one was open already, left by a program that died.

        Raises
        ------
        DeviceError
            The camera does not open a session.
        """
        try:
            self._open()
        except RefusedError as refusal:
            if refusal.code != SESSION_ALREADY_OPEN:
                raise
            self.transact(Standard.CloseSession)
            self._open()
            return True
        return False

    def close(self) -> None:
        """Close the session.

        Raises
        ------
        DeviceError
            The camera did not close it.
        """
        self.transact(Standard.CloseSession, timeouts=SHORT_TIMEOUTS)

    def transact(
        self,
        operation: IntEnum,
        *params: int,
        data: bytes | None = None,
        timeouts: Timeouts = DEFAULT_TIMEOUTS,
        most_bytes: int = MAX_ANSWER_BYTES,
    ) -> Reply:
        """Do one operation, repeated while the camera is busy.

        Parameters
        ----------
        operation
            Member of an enumeration of operation codes.
        params
            Parameters of the operation, u32 each.
        data
            Data to send in the data phase, if it has one outwards.
        timeouts
            Longest duration of the transaction.
        most_bytes
            Longest data phase that is accepted.

        Raises
        ------
        RefusedError
            The camera answered something other than OK.
        DeviceError
            The camera did not answer, or violated the protocol.
        """
        deadline_s = self._clock.now() + timeouts.busy_s
        back_off_s = FIRST_BACK_OFF_S
        while True:
            self.resynchronise()
            sent_s = self._clock.now()
            response, incoming = self._exchange(operation, params, data, timeouts, most_bytes)
            answered_s = self._clock.now()
            self._log(operation, params, response, len(incoming), answered_s - sent_s)
            if response.code == OK:
                return Reply(response.params, incoming, sent_s, answered_s)
            if response.code in SESSION_LOST:
                self._lost_by = response.code
            if response.code != DEVICE_BUSY or answered_s >= deadline_s:
                stays_busy = response.code == DEVICE_BUSY and timeouts.busy_s > 0
                remedy = NO_CARD if stays_busy and self._lacks_card() else advice(response.code)
                raise RefusedError(
                    f"expected 0x2001 OK from the camera to {operation_text(operation)}, "
                    f"got {response_text(response.code)}: {remedy}",
                    response.code,
                )
            self._clock.sleep(back_off_s)
            back_off_s = min(2 * back_off_s, MAX_BACK_OFF_S)

    def _lacks_card(self) -> bool:
        """Return whether a camera that stays busy says that no card is in it.

        The lower half of a store's number is 0 where its medium is missing (PIMA 15740, 5.2.1).
        """
        try:
            stores = self.transact(Standard.GetStorageIDs, timeouts=SHORT_TIMEOUTS).data
        except DeviceError:
            return False
        numbers = struct.unpack(f"<{len(stores) // 4}I", stores[: len(stores) // 4 * 4])[1:]
        return not any(number & 0xFFFF for number in numbers)

    def event(self, timeout_s: float) -> Container | None:
        """Return the camera's next event, None if there is none within `timeout_s`.

        Raises
        ------
        DeviceError
            The camera is gone, or its report is no event.
        """
        return self._link.event(timeout_s)

    def resynchronise(self) -> None:
        """Make the camera cancel a transaction that was broken off, if there is one.

        Raises
        ------
        DeviceError
            The camera does not resynchronise.
        """
        if self._lost_by is not None:
            raise DeviceError(
                f"the camera has lost this session, it answered {response_text(self._lost_by)}: "
                "start again"
            )
        if self._under_way is not None:
            self._link.cancel(self._under_way)
            self._under_way = None

    def start_over(self) -> None:
        """Reset the camera's side and open a session anew, when cancelling did not help.

        Raises
        ------
        DeviceError
            The reset did not help either.
        """
        self._link.reset()
        self._under_way = None
        self._lost_by = None
        self.open()

    def _log(
        self,
        operation: IntEnum,
        params: tuple[int, ...],
        response: Container,
        received_bytes: int,
        took_s: float,
    ) -> None:
        """Log a transaction; the same one with the same answer, as in polling, only once."""
        exchange = (operation, params, response.code, received_bytes)
        if exchange != self._logged:
            self._logged = exchange
            _logger.debug(
                "%s%s: %s, %d bytes, after %.3f s",
                operation_text(operation),
                "".join(f" 0x{param:X}" for param in params),
                "OK" if response.code == OK else response_text(response.code),
                received_bytes,
                took_s,
            )

    def _open(self) -> None:
        self._next_id = 0  # OpenSession is transaction 0, the session's first is 1
        self.transact(Standard.OpenSession, SESSION_ID)

    def _exchange(
        self,
        operation: IntEnum,
        params: tuple[int, ...],
        data: bytes | None,
        timeouts: Timeouts,
        most_bytes: int,
    ) -> tuple[Container, bytes]:
        transaction_id = self._next_id
        self._next_id = transaction_id % LAST_TRANSACTION_ID + 1
        doing = operation_text(operation)
        self._under_way = transaction_id
        self._link.send(command(operation, transaction_id, params), data, doing)
        incoming: bytes | None = None
        for _ in range(MAX_STALE):
            container = self._link.receive(doing, timeouts.answer_s, most_bytes)
            if container.kind is Kind.EVENT or container.transaction_id != transaction_id:
                continue  # left over from a program that died, or out of order
            if container.kind is Kind.RESPONSE:
                self._under_way = None
                return container, incoming or b""
            if container.kind is not Kind.DATA or container.code != operation or incoming:
                raise MalformedError(
                    f"{doing}: expected data or a response, the camera sent a container of kind "
                    f"{container.kind.name} and code 0x{container.code:04X}",
                    encode(container),
                    "start again",
                )
            incoming = container.payload
        raise MalformedError(
            f"{doing}: expected an answer to transaction {transaction_id}, the camera sent "
            f"{MAX_STALE} containers of others",
            encode(container),
        )
