"""Parts of PTP datasets."""

import struct


def arrays(dataset: bytes, offset: int, count: int) -> tuple[list[tuple[int, ...]], int]:
    found = []
    for _ in range(count):
        (n,) = struct.unpack_from("<I", dataset, offset)
        found.append(struct.unpack_from(f"<{n}H", dataset, offset + 4))
        offset += 4 + 2 * n
    return found, offset


def strings(dataset: bytes, offset: int) -> list[str]:
    found = []
    while offset < len(dataset):
        n = dataset[offset]
        found.append(dataset[offset + 1 : offset + 1 + 2 * n].decode("utf-16-le").rstrip("\0"))
        offset += 1 + 2 * n
    return found
