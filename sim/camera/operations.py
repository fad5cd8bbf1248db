"""What each operation does, and what it may be given."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from . import datasets
from .eos import EosBody
from .objects import CARD_ID, StoredObject
from .vocabulary import EosEvent, ObjectFormat, Operation, PtpProperty, ResponseCode

_EVERY_HANDLE = 0xFFFFFFFF
_STILL_CAMERA = 1
_MODEL = "Canon EOS 5D Mark II"


class Response(NamedTuple):
    """Answer to one operation: code, parameters, and the data phase if there is one."""

    code: int
    params: tuple[int, ...] = ()
    data: bytes | None = None


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


def _only_code(run: Callable[..., ResponseCode]) -> Callable[..., Response]:
    def answer(*arguments: object) -> Response:
        return Response(run(*arguments))

    return answer


def _text(data: bytes) -> str | None:
    """A PTP string, or None if the bytes are no such thing."""
    characters = data[0] if data else 0
    encoded = data[1:]
    if not data or len(encoded) != 2 * characters:
        return None
    return encoded.decode("utf-16-le", errors="replace").rstrip("\0")


class Operations:
    """The operations inside a session, for one camera body.

    Parameters
    ----------
    body
        What the EOS operations act on.
    serial
        Serial number of the camera.
    """

    def __init__(self, body: EosBody, serial: str) -> None:
        self._body = body
        self._store = body.objects
        self._serial = serial
        self._initiator = "Unknown Initiator"
        self.table: dict[int, Handler] = {**self._ptp_table(), **self._eos_table()}

    def device_info(self) -> Response:
        """GetDeviceInfo: lists what this camera really obeys, a part of what a 5D Mark II lists."""
        info = datasets.DeviceInfo(
            model=_MODEL,
            device_version="3-2.1.2",
            serial=self._serial,
            operations=tuple(Operation),
            events=(EosEvent.REQUEST_GET_EVENT,),
            properties=tuple(PtpProperty),
            capture_formats=(ObjectFormat.DNG,),
            image_formats=tuple(ObjectFormat),
        )
        return Response(ResponseCode.OK, data=info.encode())

    def _ptp_table(self) -> dict[int, Handler]:
        return {
            Operation.GET_STORAGE_IDS: Handler(self._storage_ids),
            Operation.GET_STORAGE_INFO: Handler(self._storage_info, 1, 1),
            Operation.GET_OBJECT_HANDLES: Handler(self._object_handles, 1, 3),
            Operation.GET_OBJECT_INFO: Handler(self._object_info, 1, 1),
            Operation.GET_OBJECT: Handler(self._object, 1, 1),
            Operation.DELETE_OBJECT: Handler(_only_code(self._delete), 1, 2),
            Operation.GET_DEVICE_PROP_DESC: Handler(self._prop_desc, 1, 1),
            Operation.GET_DEVICE_PROP_VALUE: Handler(self._prop_value, 1, 1),
            Operation.GET_PARTIAL_OBJECT: Handler(self._counted_part, 3, 3),
            Operation.SET_DEVICE_PROP_VALUE: Handler(
                _only_code(self._set_prop), 1, 1, takes_data=True
            ),
        }

    def _eos_table(self) -> dict[int, Handler]:
        body = self._body
        return {
            # libgphoto2 prepares for a capture again and again unless these two succeed
            Operation.EOS_GET_STORAGE_IDS: Handler(self._storage_ids),
            Operation.EOS_GET_STORAGE_INFO: Handler(self._storage_info, 1, 1),
            Operation.EOS_GET_OBJECT: Handler(self._object, 1, 1),
            Operation.EOS_GET_PARTIAL_OBJECT: Handler(self._part, 3, 3),
            Operation.EOS_REMOTE_RELEASE: Handler(self._release_once),
            Operation.EOS_SET_DEVICE_PROP_VALUE_EX: Handler(
                _only_code(body.set_property), takes_data=True
            ),
            Operation.EOS_SET_REMOTE_MODE: Handler(_only_code(body.set_remote_mode), 1, 1),
            Operation.EOS_SET_EVENT_MODE: Handler(_only_code(body.set_event_mode), 1, 1),
            Operation.EOS_GET_EVENT: Handler(self._events),
            Operation.EOS_TRANSFER_COMPLETE: Handler(_only_code(self._transferred), 1, 1),
            Operation.EOS_PC_HDD_CAPACITY: Handler(_only_code(body.announce_host_capacity), 3, 3),
            Operation.EOS_KEEP_DEVICE_ON: Handler(lambda: Response(ResponseCode.OK)),
            Operation.EOS_BULB_START: Handler(_only_code(body.bulb_start)),
            Operation.EOS_BULB_END: Handler(_only_code(body.bulb_end)),
            Operation.EOS_REQUEST_DEVICE_PROP_VALUE: Handler(
                _only_code(body.request_property), 1, 1
            ),
            Operation.EOS_REMOTE_RELEASE_ON: Handler(_only_code(body.release_on), 1, 2),
            Operation.EOS_REMOTE_RELEASE_OFF: Handler(_only_code(body.release_off), 1, 1),
            Operation.EOS_GET_VIEWFINDER_DATA: Handler(self._live_picture, 1, 3),
        }

    def _storage_ids(self) -> Response:
        return Response(ResponseCode.OK, data=datasets.ptp_array([CARD_ID], "I"))

    def _storage_info(self, storage_id: int) -> Response:
        if storage_id != CARD_ID:
            return Response(ResponseCode.INVALID_STORAGE_ID)
        return Response(ResponseCode.OK, data=self._store.storage_info())

    def _object_handles(self, storage_id: int, object_format: int = 0, parent: int = 0) -> Response:
        if not self._store.has_storage(storage_id):
            return Response(ResponseCode.INVALID_STORAGE_ID)
        handles = self._store.handles(object_format, parent)
        if handles is None:
            return Response(ResponseCode.INVALID_PARENT_OBJECT)
        return Response(ResponseCode.OK, data=datasets.ptp_array(handles, "I"))

    def _object_info(self, handle: int) -> Response:
        info = self._store.info(handle)
        if info is None:
            return Response(ResponseCode.INVALID_OBJECT_HANDLE)
        return Response(ResponseCode.OK, data=info.encode())

    def _object(self, handle: int) -> Response:
        stored = self._store.find(handle)
        if stored is None:
            return Response(ResponseCode.INVALID_OBJECT_HANDLE)
        return Response(ResponseCode.OK, data=stored.photograph.raw)

    def _part(self, handle: int, offset: int, size: int) -> Response:
        stored = self._store.find(handle)
        if stored is None:
            return Response(ResponseCode.INVALID_OBJECT_HANDLE)
        raw = stored.photograph.raw
        if offset > len(raw):
            return Response(ResponseCode.INVALID_PARAMETER)
        return Response(ResponseCode.OK, data=raw[offset : offset + size])

    def _counted_part(self, handle: int, offset: int, size: int) -> Response:
        part = self._part(handle, offset, size)
        return part if part.data is None else part._replace(params=(len(part.data),))

    def _delete(self, handle: int, _object_format: int = 0) -> ResponseCode:
        if handle == _EVERY_HANDLE:
            self._store.delete_all()
            return ResponseCode.OK
        if self._store.is_folder(handle):
            return ResponseCode.OBJECT_WRITE_PROTECTED
        return self._if_found(handle, self._store.delete)

    def _transferred(self, handle: int) -> ResponseCode:
        return self._if_found(handle, self._store.forget_transferred)

    def _if_found(self, handle: int, act: Callable[[StoredObject], None]) -> ResponseCode:
        stored = self._store.find(handle)
        if stored is None:
            return ResponseCode.INVALID_OBJECT_HANDLE
        act(stored)
        return ResponseCode.OK

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
