"""The ObjectInfo dataset (PIMA 15740, 5.5.2): one file in the camera, and whether it is RAW."""

import re
from dataclasses import dataclass

from ..device_info import DatasetReader

FOLDER = 0x3001
_UNDEFINED, _TIFF_EP, _DNG = 0x3000, 0x3802, 0x3811
#: Image formats that a maker defines, most of all its RAW.
_VENDOR = range(0xB000, 0xC000)
_SUFFIX = re.compile(r"\.[a-z0-9]{1,5}")
_DEVELOPED = (".jpg", ".jpeg", ".jpe", ".heic", ".heif", ".hif")


@dataclass(frozen=True)
class ObjectInfo:
    """One file in the camera.

    Attributes
    ----------
    storage
        Id of the file's card.
    object_format
        PTP object format code.
    size_bytes
        Announced size of the file, in bytes.
    name
        Name of the file.
    captured
        Date and time in the camera's form; empty where it gives none.
    """

    storage: int
    object_format: int
    size_bytes: int
    name: str
    captured: str

    @property
    def stem(self) -> str:
        """Name without its extension: the files of one capture share it (DCF)."""
        return self.name.rpartition(".")[0] or self.name

    @property
    def suffix(self) -> str:
        """Lower-case extension with its dot, such as `.nef`; empty where there is none."""
        suffix = "." + self.name.rpartition(".")[2].lower()
        return suffix if "." in self.name and _SUFFIX.fullmatch(suffix) else ""

    @property
    def is_raw(self) -> bool:
        """Whether the file can be RAW: makers give RAW files no standard format but DNG."""
        return (
            can_be_raw(self.object_format)
            and self.suffix not in ("", *_DEVELOPED)
            and self.size_bytes > 0
        )

    def __str__(self) -> str:
        return f"{self.name!r} of {self.size_bytes} bytes, format 0x{self.object_format:04X}"


def can_be_raw(object_format: int) -> bool:
    """Return whether a file of this format can be RAW."""
    return object_format in (_UNDEFINED, _TIFF_EP, _DNG) or object_format in _VENDOR


def parse_object_info(data: bytes) -> ObjectInfo:
    """Return the ObjectInfo in the data phase of GetObjectInfo.

    Raises
    ------
    MalformedError
        The dataset is cut short.
    """
    reader = DatasetReader(data, "ObjectInfo")
    storage, object_format, _protection, size_bytes = reader.numbers("IHHI")
    reader.take(2 + 6 * 4)  # thumbnail, and the image's size in pixels
    reader.take(4 + 2 + 4 + 4)  # folder, association, number in a sequence
    name, captured = reader.text(), reader.text()
    return ObjectInfo(storage, object_format, size_bytes, name, captured)
