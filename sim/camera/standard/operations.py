"""Operations of a camera that implements the PTP standard only."""

from .. import datasets
from ..object_operations import ObjectOperations
from ..operations import SESSION_OPERATIONS, Event, Handler, Response, only_code
from ..vocabulary import ObjectFormat, Operation, ResponseCode, StandardEvent
from .body import StandardBody

_MODEL = "simulated PTP camera"
_NO_EXTENSION = 0


class StandardOperations:
    """The operations inside a session, for one camera body.

    Parameters
    ----------
    body
        Body on which the operations act.
    serial
        Serial number of the camera.
    """

    def __init__(self, body: StandardBody, serial: str) -> None:
        self._body = body
        self._serial = serial
        self.model = _MODEL
        self.table: dict[int, Handler] = {
            **ObjectOperations(body.objects).table,
            body.release_code: Handler(only_code(body.initiate_capture), 0, 2),
            Operation.GET_DEVICE_PROP_DESC: Handler(self._prop_desc, 1, 1),
            Operation.GET_DEVICE_PROP_VALUE: Handler(self._prop_value, 1, 1),
            Operation.SET_DEVICE_PROP_VALUE: Handler(
                only_code(body.properties.set), 1, 1, takes_data=True
            ),
        }

    @property
    def is_exposing(self) -> bool:
        """Whether the shutter is open."""
        return self._body.is_exposing

    def device_info(self) -> Response:
        """Return DeviceInfo."""
        info = datasets.DeviceInfo(
            manufacturer="labrig",
            model=_MODEL,
            device_version="1.0",
            serial=self._serial,
            operations=tuple(sorted({*SESSION_OPERATIONS, *self.table})),
            events=tuple(StandardEvent),
            properties=self._body.properties.known,
            capture_formats=self._body.formats,
            image_formats=tuple(ObjectFormat),
            vendor_extension=_NO_EXTENSION,
        )
        return Response(ResponseCode.OK, data=info.encode())

    def is_too_busy_for(self, opcode: int) -> bool:
        """Return whether this operation has to wait for the end of an exposure."""
        return self._body.is_exposing and opcode != Operation.GET_DEVICE_INFO

    def forget_host(self) -> None:
        """End the session."""
        self._body.forget_host()

    def event_due_s(self) -> float:
        """Return the time of the next event."""
        return self._body.event_due_s()

    def take_event(self) -> Event:
        """Return the event that is due; each is reported once."""
        return self._body.take_event()

    def _prop_desc(self, code: int) -> Response:
        return _data_response(self._body.properties.description(code))

    def _prop_value(self, code: int) -> Response:
        return _data_response(self._body.properties.value(code))


def _data_response(data: bytes | None) -> Response:
    if data is None:
        return Response(ResponseCode.DEVICE_PROP_NOT_SUPPORTED)
    return Response(ResponseCode.OK, data=data)
