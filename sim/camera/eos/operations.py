"""Operations of an EOS and their parameters."""

from .. import datasets
from ..object_operations import ObjectOperations
from ..operations import SESSION_OPERATIONS, Event, Handler, Response, only_code
from ..vocabulary import EosEvent, ObjectFormat, Operation, PtpProperty, ResponseCode
from .body import EosBody

_STILL_CAMERA = 1
_MODEL = "Canon EOS 5D Mark II"
_CANON = 0xB
#: What an open shutter leaves answerable: being asked, by the standard being identified, and the
#: finger off the button, which libgphoto2's trigger takes for granted at any EOS.
_WHILE_EXPOSING = frozenset(
    {Operation.EOS_GET_EVENT, Operation.GET_DEVICE_INFO, Operation.EOS_REMOTE_RELEASE_OFF}
)


def _text(data: bytes) -> str | None:
    """Return a PTP string, or None if the bytes are none."""
    characters = data[0] if data else 0
    encoded = data[1:]
    if not data or len(encoded) != 2 * characters:
        return None
    return encoded.decode("utf-16-le", errors="replace").rstrip("\0")


class EosOperations:
    """The operations inside a session, for one camera body.

    Parameters
    ----------
    body
        Body on which the EOS operations act.
    serial
        Serial number of the camera.
    """

    def __init__(self, body: EosBody, serial: str) -> None:
        self._body = body
        self._objects = ObjectOperations(body.objects)
        self._serial = serial
        self._initiator = "Unknown Initiator"
        self.model = _MODEL
        self.table: dict[int, Handler] = {
            **self._objects.table,
            **self._property_table(),
            **self._eos_table(),
        }

    @property
    def is_exposing(self) -> bool:
        """Whether the shutter is open."""
        return self._body.is_exposing

    def device_info(self) -> Response:
        """Return DeviceInfo with the operations that this camera obeys, some of a 5D Mark II's."""
        info = datasets.DeviceInfo(
            manufacturer="Canon Inc.",
            model=_MODEL,
            device_version="3-2.1.2",
            serial=self._serial,
            operations=tuple(sorted({*SESSION_OPERATIONS, *self.table})),
            events=(EosEvent.REQUEST_GET_EVENT,),
            properties=tuple(PtpProperty),
            capture_formats=(ObjectFormat.DNG,),
            image_formats=(ObjectFormat.ASSOCIATION, ObjectFormat.DNG),
            vendor_extension=_CANON,
        )
        return Response(ResponseCode.OK, data=info.encode())

    def is_too_busy_for(self, opcode: int) -> bool:
        """Return whether this operation has to wait for the end of an exposure."""
        if not self._body.is_exposing or opcode in _WHILE_EXPOSING:
            return False
        return not (self._body.bulb_is_open and opcode == Operation.EOS_BULB_END)

    def forget_host(self) -> None:
        """End the session."""
        self._body.forget_host()

    def event_due_s(self) -> float:
        """Return the time at which the camera will next announce records."""
        return self._body.events.knock_due_s()

    def take_event(self) -> Event:
        """Return the announcement of records; sent once until the host fetches."""
        self._body.events.knock()
        return Event(EosEvent.REQUEST_GET_EVENT)

    def _property_table(self) -> dict[int, Handler]:
        return {
            Operation.GET_DEVICE_PROP_DESC: Handler(self._prop_desc, 1, 1),
            Operation.GET_DEVICE_PROP_VALUE: Handler(self._prop_value, 1, 1),
            Operation.SET_DEVICE_PROP_VALUE: Handler(
                only_code(self._set_prop), 1, 1, takes_data=True
            ),
        }

    def _eos_table(self) -> dict[int, Handler]:
        body, objects = self._body, self._objects
        return {
            # libgphoto2 prepares for a capture again and again unless these two succeed
            Operation.EOS_GET_STORAGE_IDS: Handler(objects.storage_ids),
            Operation.EOS_GET_STORAGE_INFO: Handler(objects.storage_info, 1, 1),
            Operation.EOS_GET_OBJECT: Handler(objects.whole, 1, 1),
            Operation.EOS_GET_PARTIAL_OBJECT: Handler(objects.part, 3, 3),
            Operation.EOS_REMOTE_RELEASE: Handler(self._release_once),
            Operation.EOS_SET_DEVICE_PROP_VALUE_EX: Handler(
                only_code(body.set_property), takes_data=True
            ),
            Operation.EOS_SET_REMOTE_MODE: Handler(only_code(body.set_remote_mode), 1, 1),
            Operation.EOS_SET_EVENT_MODE: Handler(only_code(body.set_event_mode), 1, 1),
            Operation.EOS_GET_EVENT: Handler(self._events),
            Operation.EOS_TRANSFER_COMPLETE: Handler(only_code(self._transferred), 1, 1),
            Operation.EOS_PC_HDD_CAPACITY: Handler(only_code(body.announce_host_capacity), 3, 3),
            Operation.EOS_KEEP_DEVICE_ON: Handler(lambda: Response(ResponseCode.OK)),
            Operation.EOS_BULB_START: Handler(only_code(body.bulb_start)),
            Operation.EOS_BULB_END: Handler(only_code(body.bulb_end)),
            Operation.EOS_REQUEST_DEVICE_PROP_VALUE: Handler(
                only_code(body.request_property), 1, 1
            ),
            Operation.EOS_REMOTE_RELEASE_ON: Handler(only_code(body.release_on), 1, 2),
            Operation.EOS_REMOTE_RELEASE_OFF: Handler(only_code(body.release_off), 1, 1),
            Operation.EOS_GET_VIEWFINDER_DATA: Handler(self._live_picture, 1, 3),
        }

    def _transferred(self, handle: int) -> ResponseCode:
        return self._objects.if_found(handle, self._body.objects.forget_transferred)

    def _prop_desc(self, code: int) -> Response:
        match code:
            case PtpProperty.PERCEIVED_DEVICE_TYPE:
                data = datasets.uint32_prop_desc(code, _STILL_CAMERA)
            case PtpProperty.FRIENDLY_NAME:
                data = datasets.string_prop_desc(code, _MODEL, datasets.READ_ONLY)
            case PtpProperty.SESSION_INITIATOR:
                data = datasets.string_prop_desc(code, self._initiator, datasets.READ_WRITE)
            case _:
                return Response(ResponseCode.DEVICE_PROP_NOT_SUPPORTED)
        return Response(ResponseCode.OK, data=data)

    def _prop_value(self, code: int) -> Response:
        match code:
            case PtpProperty.PERCEIVED_DEVICE_TYPE:
                data = _STILL_CAMERA.to_bytes(4, "little")
            case PtpProperty.FRIENDLY_NAME:
                data = datasets.ptp_string(_MODEL)
            case PtpProperty.SESSION_INITIATOR:
                data = datasets.ptp_string(self._initiator)
            case _:
                return Response(ResponseCode.DEVICE_PROP_NOT_SUPPORTED)
        return Response(ResponseCode.OK, data=data)

    def _set_prop(self, code: int, data: bytes) -> ResponseCode:
        if code not in tuple(PtpProperty):
            return ResponseCode.DEVICE_PROP_NOT_SUPPORTED
        if code != PtpProperty.SESSION_INITIATOR:
            return ResponseCode.ACCESS_DENIED
        text = _text(data)
        if text is None:
            return ResponseCode.INVALID_DEVICE_PROP_FORMAT
        self._initiator = text
        return ResponseCode.OK

    def _release_once(self) -> Response:
        code = self._body.release_once()
        # The older operation also says what went wrong with the photograph; here nothing does.
        return Response(code, (0,) if code is ResponseCode.OK else ())

    def _live_picture(self, *_which: int) -> Response:
        records = self._body.viewfinder.records()
        if records is None:
            return Response(ResponseCode.EOS_OBJECT_NOT_READY)
        return Response(ResponseCode.OK, data=records)

    def _events(self) -> Response:
        return Response(ResponseCode.OK, data=self._body.events.fetch())
