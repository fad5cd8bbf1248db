"""PTP datasets as this camera fills them in (ISO 15740, clause 5), little-endian."""

import struct
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime

_UINT32 = 0x0006
_STRING = 0xFFFF
#: Whether the host may set a property.
READ_ONLY, READ_WRITE = 0, 1

_REMOVABLE_RAM = 4
_DCF = 3
_UNKNOWN_COUNT = 0xFFFFFFFF
_ASSOCIATION_FORMAT, _GENERIC_FOLDER = 0x3001, 1


def ptp_string(text: str) -> bytes:
    """Return the length with the final zero, then UTF-16; an empty string is one zero byte."""
    if not text:
        return b"\0"
    encoded = (text + "\0").encode("utf-16-le")
    return bytes([len(encoded) // 2]) + encoded


def ptp_array(values: Iterable[int], item: str) -> bytes:
    """Return the count, then the items in the struct format `item`."""
    items = list(values)
    return struct.pack(f"<I{len(items)}{item}", len(items), *items)


def ptp_time(wall_s: float) -> str:
    """Return YYYYMMDDThhmmss of seconds since 1970."""
    return datetime.fromtimestamp(wall_s, UTC).strftime("%Y%m%dT%H%M%S")


@dataclass(frozen=True)
class DeviceInfo:
    """Identity and abilities of the camera."""

    manufacturer: str
    model: str
    device_version: str
    serial: str
    operations: tuple[int, ...]
    events: tuple[int, ...]
    properties: tuple[int, ...]
    capture_formats: tuple[int, ...]
    image_formats: tuple[int, ...]
    vendor_extension: int

    def encode(self) -> bytes:
        """Return the DeviceInfo dataset."""
        standard_version, vendor_version, functional_mode = 100, 200, 0
        return b"".join(
            (
                struct.pack("<HIH", standard_version, self.vendor_extension, vendor_version),
                ptp_string(""),
                struct.pack("<H", functional_mode),
                ptp_array(self.operations, "H"),
                ptp_array(self.events, "H"),
                ptp_array(self.properties, "H"),
                ptp_array(self.capture_formats, "H"),
                ptp_array(self.image_formats, "H"),
                ptp_string(self.manufacturer),
                ptp_string(self.model),
                ptp_string(self.device_version),
                ptp_string(self.serial),
            )
        )


@dataclass(frozen=True)
class ObjectInfo:
    """Properties of one object: a photograph or a folder."""

    storage_id: int
    object_format: int
    size: int
    parent: int
    name: str
    captured: str

    def encode(self) -> bytes:
        """Return the ObjectInfo dataset, without thumbnail and image size."""
        association = _GENERIC_FOLDER if self.object_format == _ASSOCIATION_FORMAT else 0
        return (
            struct.pack("<IHHI", self.storage_id, self.object_format, 0, self.size)
            + struct.pack("<HIII", 0, 0, 0, 0)
            + struct.pack("<III", 0, 0, 0)
            + struct.pack("<IHII", self.parent, association, 0, 0)
            + ptp_string(self.name)
            + ptp_string(self.captured)
            + ptp_string(self.captured)
            + ptp_string("")
        )


def storage_info(capacity_bytes: int, free_bytes: int) -> bytes:
    """Return the StorageInfo dataset of a memory card."""
    return (
        struct.pack("<HHH", _REMOVABLE_RAM, _DCF, 0)
        + struct.pack("<QQI", capacity_bytes, free_bytes, _UNKNOWN_COUNT)
        + ptp_string("CF")
        + ptp_string("")
    )


def string_prop_desc(code: int, value: str, access: int) -> bytes:
    """Return the DevicePropDesc of a text, without a form."""
    text = ptp_string(value)
    return struct.pack("<HHB", code, _STRING, access) + text + text + b"\0"


def uint32_prop_desc(code: int, value: int) -> bytes:
    """Return the DevicePropDesc of a read-only number, without a form."""
    return struct.pack("<HHBIIB", code, _UINT32, READ_ONLY, value, value, 0)
