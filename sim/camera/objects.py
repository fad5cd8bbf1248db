"""What the camera keeps: photographs on the card, and those that wait in memory for the host."""

from dataclasses import dataclass

from labrig.clock import Clock

from .datasets import ObjectInfo, ptp_time, storage_info
from .sensor import Photograph
from .vocabulary import ObjectFormat

#: The one card.
CARD_ID = 0x00010001
_CARD_BYTES = 32_270_778_368
_CARD_SHOTS = 999
#: A 21-megapixel RAW file, as the camera reckons with it.
SHOT_BYTES = 25_800_000

_DCIM, _FOLDER = 0x90000000, 0x90000001
_FIRST_HANDLE = 0x91000001
_ALL = 0xFFFFFFFF
_IN_ROOT = 0xFFFFFFFF


@dataclass(frozen=True)
class StoredObject:
    """One photograph in the camera; it can be seen from `available_s` on."""

    handle: int
    storage_id: int
    name: str
    available_s: float
    photograph: Photograph


class ObjectStore:
    """Objects by handle, the folders DCIM and 100CANON among them."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._objects: dict[int, StoredObject] = {}
        self._count = 0

    @property
    def free_shots(self) -> int:
        """Photographs that still fit on the card."""
        on_card = sum(item.storage_id == CARD_ID for item in self._objects.values())
        return _CARD_SHOTS - on_card

    def add(self, storage_id: int, available_s: float, photograph: Photograph) -> StoredObject:
        """Number and keep one photograph; `storage_id` 0 is the camera's memory."""
        handle = _FIRST_HANDLE + self._count
        self._count += 1
        name = f"IMG_{self._count:04d}.DNG"
        stored = StoredObject(handle, storage_id, name, available_s, photograph)
        self._objects[handle] = stored
        return stored

    def find(self, handle: int) -> StoredObject | None:
        """The photograph of that handle, if it is over and still there."""
        stored = self._objects.get(handle)
        if stored is None or stored.available_s > self._clock.now():
            return None
        return stored

    def forget_transferred(self, stored: StoredObject) -> None:
        """The host has it: memory is free again, a card keeps its file."""
        if stored.storage_id != CARD_ID:
            del self._objects[stored.handle]

    def forget_memory(self) -> None:
        """The host is gone: what waited for it is lost."""
        for stored in list(self._objects.values()):
            if self.find(stored.handle) is stored:
                self.forget_transferred(stored)

    def delete(self, stored: StoredObject) -> None:
        """Erase one photograph."""
        del self._objects[stored.handle]

    def delete_all(self) -> None:
        """Erase the card."""
        for handle in self._on_card():
            del self._objects[handle]

    def is_folder(self, handle: int) -> bool:
        """Whether that handle is one of the card's two folders."""
        return handle in (_DCIM, _FOLDER)

    def has_storage(self, storage_id: int) -> bool:
        """Whether that is the card, or all cards."""
        return storage_id in (CARD_ID, _ALL)

    def handles(self, object_format: int, parent: int) -> list[int] | None:
        """Handles on the card as GetObjectHandles asks for them; None if `parent` is no folder."""
        tree = {_IN_ROOT: [_DCIM], _DCIM: [_FOLDER], _FOLDER: self._on_card()}
        tree[0] = [_DCIM, _FOLDER, *self._on_card()]
        if parent not in tree:
            return None
        return [h for h in tree[parent] if object_format in (0, self._format(h))]

    def info(self, handle: int) -> ObjectInfo | None:
        """ObjectInfo of a photograph or a folder."""
        if handle in (_DCIM, _FOLDER):
            parent, name = (0, "DCIM") if handle == _DCIM else (_DCIM, "100CANON")
            return ObjectInfo(CARD_ID, ObjectFormat.ASSOCIATION, 0, parent, name, "")
        stored = self.find(handle)
        if stored is None:
            return None
        return ObjectInfo(
            stored.storage_id,
            ObjectFormat.DNG,
            len(stored.photograph.raw),
            self.parent(stored),
            stored.name,
            ptp_time(self._clock.wall(stored.photograph.start_s)),
        )

    def parent(self, stored: StoredObject) -> int:
        """The folder that a photograph is in; 0 in memory."""
        return _FOLDER if stored.storage_id == CARD_ID else 0

    def storage_info(self) -> bytes:
        """The StorageInfo dataset of the card."""
        return storage_info(_CARD_BYTES, self.free_shots * SHOT_BYTES)

    def _on_card(self) -> list[int]:
        return [
            handle
            for handle, stored in self._objects.items()
            if stored.storage_id == CARD_ID and self.find(handle)
        ]

    def _format(self, handle: int) -> int:
        return ObjectFormat.ASSOCIATION if self.is_folder(handle) else ObjectFormat.DNG
