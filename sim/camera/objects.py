"""Storage of the camera: photographs on cards, and those that wait in memory for the host."""

from dataclasses import dataclass

from labrig.foundation.clock import Clock

from .datasets import ObjectInfo, ptp_time, storage_info
from .photograph import Photograph
from .vocabulary import ObjectFormat

#: The first card, and one more in another slot.
CARD_ID, SECOND_CARD_ID = 0x00010001, 0x00020001
_CARD_BYTES = 32_270_778_368
_CARD_SHOTS = 999
#: A 21-megapixel RAW file, as the camera reckons with it.
SHOT_BYTES = 25_800_000

_DCIM, _FOLDER = 0x90000000, 0x90000001
_FIRST_HANDLE = 0x91000001
_ALL = 0xFFFFFFFF
_SUFFIXES = {ObjectFormat.DNG: "DNG", ObjectFormat.JPEG: "JPG"}
_IN_ROOT = 0xFFFFFFFF


@dataclass(frozen=True)
class StoredObject:
    """One file in the camera, visible from `available_s` on."""

    handle: int
    storage_id: int
    name: str
    available_s: float
    photograph: Photograph
    object_format: ObjectFormat = ObjectFormat.DNG


class ObjectStore:
    """Objects by handle, the folders of the first card among them.

    Parameters
    ----------
    clock
        The room's clock.
    folder, prefix
        Folder in DCIM of the camera's photographs, and start of their names.
    cards
        Storage ids; a second card has no folders.
    """

    def __init__(
        self, clock: Clock, folder: str, prefix: str, cards: tuple[int, ...] = (CARD_ID,)
    ) -> None:
        self.cards = cards
        self._clock = clock
        self._folder = folder
        self._prefix = prefix
        self._objects: dict[int, StoredObject] = {}
        self._count = self._files = 0

    @property
    def free_shots(self) -> int:
        """Number of photographs that still fit on the card."""
        on_card = sum(item.storage_id == CARD_ID for item in self._objects.values())
        return _CARD_SHOTS - on_card

    def begin_photograph(self) -> None:
        """Give all later files the next number."""
        self._count += 1

    def add(
        self,
        storage_id: int,
        available_s: float,
        photograph: Photograph,
        object_format: ObjectFormat = ObjectFormat.DNG,
    ) -> StoredObject:
        """Keep one file of a photograph; `storage_id` 0 is the camera's memory."""
        handle = _FIRST_HANDLE + self._files
        self._files += 1
        name = f"{self._prefix}_{self._count:04d}.{_SUFFIXES[object_format]}"
        stored = StoredObject(handle, storage_id, name, available_s, photograph, object_format)
        self._objects[handle] = stored
        return stored

    def all(self) -> tuple[StoredObject, ...]:
        """Return every visible file."""
        return tuple(stored for stored in self._objects.values() if self.find(stored.handle))

    def find(self, handle: int) -> StoredObject | None:
        """Return the photograph of that handle, if it is over and still there."""
        stored = self._objects.get(handle)
        if stored is None or stored.available_s > self._clock.now():
            return None
        return stored

    def forget_transferred(self, stored: StoredObject) -> None:
        """Free the memory of a transferred file; a card keeps its file."""
        if stored.storage_id not in self.cards:
            del self._objects[stored.handle]

    def forget_memory(self) -> None:
        """Delete the files in memory, whose host is gone."""
        for stored in list(self._objects.values()):
            if self.find(stored.handle) is stored:
                self.forget_transferred(stored)

    def delete(self, stored: StoredObject) -> None:
        """Delete one photograph."""
        del self._objects[stored.handle]

    def delete_all(self) -> None:
        """Delete all photographs on the card."""
        for handle in self._on_card():
            del self._objects[handle]

    def is_folder(self, handle: int) -> bool:
        """Return whether that handle is one of the card's two folders."""
        return handle in (_DCIM, _FOLDER)

    def has_storage(self, storage_id: int) -> bool:
        """Return whether that id is a card's, or stands for all cards."""
        return storage_id in (*self.cards, _ALL)

    def handles(self, object_format: int, parent: int) -> list[int] | None:
        """Return handles on cards for GetObjectHandles; None if `parent` is no folder."""
        tree = {_IN_ROOT: [_DCIM], _DCIM: [_FOLDER], _FOLDER: self._on_card()}
        tree[0] = [_DCIM, _FOLDER, *self._on_card()]
        if parent not in tree:
            return None
        return [h for h in tree[parent] if object_format in (0, self._format(h))]

    def info(self, handle: int) -> ObjectInfo | None:
        """Return ObjectInfo of a photograph or a folder."""
        if handle in (_DCIM, _FOLDER):
            parent, name = (0, "DCIM") if handle == _DCIM else (_DCIM, self._folder)
            return ObjectInfo(CARD_ID, ObjectFormat.ASSOCIATION, 0, parent, name, "")
        stored = self.find(handle)
        if stored is None:
            return None
        return ObjectInfo(
            stored.storage_id,
            stored.object_format,
            len(stored.photograph.raw),
            self.parent(stored),
            stored.name,
            ptp_time(self._clock.wall(stored.photograph.start_s)),
        )

    def parent(self, stored: StoredObject) -> int:
        """Return the folder of a photograph; 0 in memory."""
        return _FOLDER if stored.storage_id == CARD_ID else 0

    def storage_info(self) -> bytes:
        """Return the StorageInfo dataset of the card."""
        return storage_info(_CARD_BYTES, self.free_shots * SHOT_BYTES)

    def _on_card(self) -> list[int]:
        return [
            handle
            for handle, stored in self._objects.items()
            if stored.storage_id in self.cards and self.find(handle)
        ]

    def _format(self, handle: int) -> int:
        if self.is_folder(handle):
            return ObjectFormat.ASSOCIATION
        return self._objects[handle].object_format
