"""Operations on the camera's storage: cards, folders, files."""

from collections.abc import Callable

from . import datasets
from .objects import ObjectStore, StoredObject
from .operations import Handler, Response, only_code
from .vocabulary import Operation, ResponseCode

_EVERY_HANDLE = 0xFFFFFFFF


class ObjectOperations:
    """The standard's own operations on an `ObjectStore`."""

    def __init__(self, store: ObjectStore) -> None:
        self._store = store

    @property
    def table(self) -> dict[int, Handler]:
        """Return all operations on objects."""
        return {
            Operation.GET_STORAGE_IDS: Handler(self.storage_ids),
            Operation.GET_STORAGE_INFO: Handler(self.storage_info, 1, 1),
            Operation.GET_OBJECT_HANDLES: Handler(self._object_handles, 1, 3),
            Operation.GET_OBJECT_INFO: Handler(self._object_info, 1, 1),
            Operation.GET_OBJECT: Handler(self.whole, 1, 1),
            Operation.DELETE_OBJECT: Handler(only_code(self._delete), 1, 2),
            Operation.GET_PARTIAL_OBJECT: Handler(self._counted_part, 3, 3),
        }

    def storage_ids(self) -> Response:
        """Return the ids of the cards."""
        return Response(ResponseCode.OK, data=datasets.ptp_array(self._store.cards, "I"))

    def storage_info(self, storage_id: int) -> Response:
        """Return StorageInfo of one card."""
        if storage_id not in self._store.cards:
            return Response(ResponseCode.INVALID_STORAGE_ID)
        return Response(ResponseCode.OK, data=self._store.storage_info())

    def whole(self, handle: int) -> Response:
        """Return all of a file."""
        stored = self._store.find(handle)
        if stored is None:
            return Response(ResponseCode.INVALID_OBJECT_HANDLE)
        return Response(ResponseCode.OK, data=stored.photograph.raw)

    def part(self, handle: int, offset: int, size: int) -> Response:
        """Return a part of a file."""
        stored = self._store.find(handle)
        if stored is None:
            return Response(ResponseCode.INVALID_OBJECT_HANDLE)
        raw = stored.photograph.raw
        if offset > len(raw):
            return Response(ResponseCode.INVALID_PARAMETER)
        return Response(ResponseCode.OK, data=raw[offset : offset + size])

    def if_found(self, handle: int, act: Callable[[StoredObject], None]) -> ResponseCode:
        """Apply a function to a file, if it exists."""
        stored = self._store.find(handle)
        if stored is None:
            return ResponseCode.INVALID_OBJECT_HANDLE
        act(stored)
        return ResponseCode.OK

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

    def _counted_part(self, handle: int, offset: int, size: int) -> Response:
        part = self.part(handle, offset, size)
        return part if part.data is None else part._replace(params=(len(part.data),))

    def _delete(self, handle: int, _object_format: int = 0) -> ResponseCode:
        if handle == _EVERY_HANDLE:
            self._store.delete_all()
            return ResponseCode.OK
        if self._store.is_folder(handle):
            return ResponseCode.OBJECT_WRITE_PROTECTED
        return self.if_found(handle, self._store.delete)
