"""Frames compressed as a Canon compresses them: lossless JPEG, here inside a DNG.

ITU-T T.81, process 14 with predictor 1: the difference to the pixel before of the same colour, by
how many bits it takes (a Huffman code) and then those bits. Two components a line, as cameras do
for a Bayer mosaic. Every number of bits has a code of the same length, which real files better by
a tenth.
"""

import struct

import numpy as np
import numpy.typing as npt

from labrig.sim.dng import Shot, encode_dng

_COMPRESSION, _STRIP_BYTES = 259, 279
_LOSSLESS_JPEG = 7
#: Bits of a difference: 0 to 16, each with a code of five bits.
_CATEGORIES, _CODE_BITS = 17, 5
_LONGEST = _CODE_BITS + 15
#: Rows packed at a time: 20 bits a pixel take a byte each while they are packed.
_ROWS = 64


def encode_compressed_dng(mosaic: npt.NDArray[np.uint16], shot: Shot) -> bytes:
    """As `sim.dng.encode_dng`, its pixels compressed."""
    plain = encode_dng(mosaic, shot)
    header, pixels = bytearray(plain[: -mosaic.nbytes]), _encode(mosaic)
    for tag, kind, value in (
        (_COMPRESSION, "H", _LOSSLESS_JPEG),
        (_STRIP_BYTES, "I", len(pixels)),
    ):
        entry = header.index(struct.pack("<HH", tag, 3 if kind == "H" else 4))
        struct.pack_into(f"<{kind}", header, entry + 8, value)
    return bytes(header) + pixels


def _encode(mosaic: npt.NDArray[np.uint16]) -> bytes:
    height, width = mosaic.shape
    huffman = bytes([0] * (_CODE_BITS - 1) + [_CATEGORIES] + [0] * (16 - _CODE_BITS))
    components = b"".join(bytes([number, 0x11, 0]) for number in (1, 2))
    start = struct.pack(">BHHB", 16, height, width // 2, 2) + components
    scan = bytes([2, 1, 0x00, 2, 0x00, 1, 0, 0])
    return b"".join(
        [
            b"\xff\xd8",
            _segment(0xC4, b"\x00" + huffman + bytes(range(_CATEGORIES))),
            _segment(0xC3, start),
            _segment(0xDA, scan),
            _packed(_differences(mosaic)).replace(b"\xff", b"\xff\x00"),
            b"\xff\xd9",
        ]
    )


def _segment(marker: int, content: bytes) -> bytes:
    return struct.pack(">BBH", 0xFF, marker, len(content) + 2) + content


def _differences(mosaic: npt.NDArray[np.uint16]) -> npt.NDArray[np.int16]:
    """To the pixel two before; in a row's first ones to those above, in the first row's to 2^15."""
    values = mosaic.astype(np.int32)
    before = np.empty_like(values)
    before[:, 2:] = values[:, :-2]
    before[1:, :2] = values[:-1, :2]
    before[0, :2] = 1 << 15
    return (values - before).astype(np.int16)


def _packed(differences: npt.NDArray[np.int16]) -> bytes:
    parts = []
    for top in range(0, len(differences), _ROWS):
        number = differences[top : top + _ROWS].ravel().astype(np.int32)
        bits = np.ceil(np.log2(np.abs(number) + 1)).astype(np.int32)
        # A negative number is written as what it lacks to its highest one, less one.
        written = np.where(number < 0, number + (1 << bits) - 1, number) & ((1 << bits) - 1)
        code = (bits << bits) | written
        place = np.arange(_LONGEST - 1, -1, -1)
        used = place < (bits + _CODE_BITS)[:, np.newaxis]
        parts.append(((code[:, np.newaxis] >> place) & 1).astype(np.uint8)[used])
    whole = np.concatenate(parts)
    return np.packbits(np.append(whole, np.ones(-len(whole) % 8, np.uint8))).tobytes()
