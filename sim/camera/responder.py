"""The camera as a PTP responder, whatever carries the containers."""

from labrig.clock import Clock

from .body_settings import BodySettings
from .eos import EosBody
from .faults import CameraFaults
from .operations import Handler, Operations, Response
from .sensor import Sensor
from .shutter import Shutter
from .vocabulary import EosEvent, Operation, ResponseCode

_LAST_TRANSACTION = 0xFFFFFFFE
#: What an open shutter leaves answerable: being asked, and by the standard being identified.
_WHILE_EXPOSING = frozenset({Operation.EOS_GET_EVENT, Operation.GET_DEVICE_INFO})
#: And what ends a bulb exposure.
_WHILE_BULB = frozenset({Operation.EOS_REMOTE_RELEASE_OFF, Operation.EOS_BULB_END})


class Responder:
    """Session, transaction ids and dispatch.

    Parameters
    ----------
    clock
        Only asked for the time; who carries the containers lets it pass.
    sensor
        Makes the photographs.
    shutter
        Button and shutter.
    serial
        Serial number in DeviceInfo.
    faults
        What is wrong with the body.
    settings
        What somebody has set on the body by hand.
    """

    def __init__(
        self,
        clock: Clock,
        sensor: Sensor,
        shutter: Shutter,
        serial: str,
        faults: CameraFaults,
        settings: BodySettings,
    ) -> None:
        self._body = EosBody(clock, sensor, shutter, faults, settings)
        self._operations = Operations(self._body, serial)
        self._table = {
            **self._operations.table,
            Operation.CLOSE_SESSION: Handler(self._close_session),
        }
        self._session_id = 0
        self._next_transaction = 0

    def takes_data(self, opcode: int) -> bool:
        """Whether the host sends a data phase after this command."""
        handler = self._table.get(opcode)
        return handler is not None and handler.takes_data

    def transaction(
        self, opcode: int, transaction_id: int, params: tuple[int, ...], data: bytes = b""
    ) -> Response:
        """Do one operation.

        Every transaction inside a session counts, also one that is refused; a wrong transaction
        id does not.
        """
        if opcode == Operation.OPEN_SESSION:
            return self._open_session(transaction_id, params)
        if self._session_id:
            if transaction_id != self._next_transaction:
                return Response(ResponseCode.INVALID_TRANSACTION_ID)
            self._count_transaction()
        elif opcode == Operation.GET_DEVICE_INFO and transaction_id:
            return Response(ResponseCode.INVALID_TRANSACTION_ID)
        if self._is_too_busy_for(opcode):
            return Response(ResponseCode.DEVICE_BUSY)
        if opcode == Operation.GET_DEVICE_INFO:
            return self._operations.device_info()
        return self._in_session(opcode, params, data)

    def abandon(self, transaction_id: int) -> None:
        """A transaction that began and will not be finished: it counts."""
        if self._session_id and transaction_id == self._next_transaction:
            self._count_transaction()

    def disconnect(self) -> None:
        """The host is gone or has reset the camera: no session, nobody to report to."""
        self._session_id = 0
        self._body.forget_host()

    def event_due_s(self) -> float:
        """When the camera will next say by itself that there is something to fetch."""
        return self._body.events.knock_due_s()

    def take_event(self) -> int:
        """The code of that event, sent once until the host fetches."""
        self._body.events.knock()
        return EosEvent.REQUEST_GET_EVENT

    def _open_session(self, transaction_id: int, params: tuple[int, ...]) -> Response:
        if self._session_id:
            return Response(ResponseCode.SESSION_ALREADY_OPEN, (self._session_id,))
        if transaction_id:
            return Response(ResponseCode.INVALID_TRANSACTION_ID)
        if self._body.is_exposing:
            return Response(ResponseCode.DEVICE_BUSY)
        if not params or not params[0]:
            return Response(ResponseCode.INVALID_PARAMETER)
        self._session_id = params[0]
        self._next_transaction = 1
        return Response(ResponseCode.OK)

    def _close_session(self) -> Response:
        self.disconnect()
        return Response(ResponseCode.OK)

    def _in_session(self, opcode: int, params: tuple[int, ...], data: bytes) -> Response:
        handler = self._table.get(opcode)
        if handler is None:
            return Response(ResponseCode.OPERATION_NOT_SUPPORTED)
        if not self._session_id:
            return Response(ResponseCode.SESSION_NOT_OPEN)
        if len(params) < handler.required:
            return Response(ResponseCode.INVALID_PARAMETER)
        if any(params[handler.most :]):
            return Response(ResponseCode.PARAMETER_NOT_SUPPORTED)
        return handler.run(*params[: handler.most], *([data] if handler.takes_data else []))

    def _is_too_busy_for(self, opcode: int) -> bool:
        if not self._body.is_exposing or opcode in _WHILE_EXPOSING:
            return False
        return not (self._body.bulb_is_open and opcode in _WHILE_BULB)

    def _count_transaction(self) -> None:
        past_last = self._next_transaction == _LAST_TRANSACTION
        self._next_transaction = 1 if past_last else self._next_transaction + 1
