"""The camera as a PTP responder, independent of the transport of containers."""

from .operations import Event, Handler, Operations, Response
from .vocabulary import Operation, ResponseCode

_LAST_TRANSACTION = 0xFFFFFFFE


class Responder:
    """Session, transaction ids and dispatch.

    Parameters
    ----------
    operations
        Operations of the camera, whose time the transport advances.
    """

    def __init__(self, operations: Operations) -> None:
        self._operations = operations
        self._table = {
            **operations.table,
            Operation.CLOSE_SESSION: Handler(self._close_session),
        }
        self._session_id = 0
        self._next_transaction = 0

    @property
    def model(self) -> str:
        """Name of the camera's model."""
        return self._operations.model

    def takes_data(self, opcode: int) -> bool:
        """Return whether the host sends a data phase after this command."""
        handler = self._table.get(opcode)
        return handler is not None and handler.takes_data

    def transaction(
        self, opcode: int, transaction_id: int, params: tuple[int, ...], data: bytes = b""
    ) -> Response:
        """Do one operation.

        Every transaction inside a session counts, also one that is refused; a wrong transaction id
        does not.
        """
        if opcode == Operation.OPEN_SESSION:
            return self._open_session(transaction_id, params)
        if self._session_id:
            if transaction_id != self._next_transaction:
                return Response(ResponseCode.INVALID_TRANSACTION_ID)
            self._count_transaction()
        elif opcode == Operation.GET_DEVICE_INFO and transaction_id:
            return Response(ResponseCode.INVALID_TRANSACTION_ID)
        if self._operations.is_too_busy_for(opcode):
            return Response(ResponseCode.DEVICE_BUSY)
        if opcode == Operation.GET_DEVICE_INFO:
            return self._operations.device_info()
        return self._in_session(opcode, params, data)

    def abandon(self, transaction_id: int) -> None:
        """Count a transaction that began and will not be finished."""
        if self._session_id and transaction_id == self._next_transaction:
            self._count_transaction()

    def disconnect(self) -> None:
        """End the session of a host that is gone or has reset the camera."""
        self._session_id = 0
        self._operations.forget_host()

    def event_due_s(self) -> float:
        """Return the time of the next event."""
        return self._operations.event_due_s()

    def take_event(self) -> Event:
        """Return the event that is due; each is reported once."""
        return self._operations.take_event()

    def _open_session(self, transaction_id: int, params: tuple[int, ...]) -> Response:
        if self._session_id:
            return Response(ResponseCode.SESSION_ALREADY_OPEN, (self._session_id,))
        if transaction_id:
            return Response(ResponseCode.INVALID_TRANSACTION_ID)
        if self._operations.is_exposing:
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

    def _count_transaction(self) -> None:
        past_last = self._next_transaction == _LAST_TRANSACTION
        self._next_transaction = 1 if past_last else self._next_transaction + 1
