"""Reading the datasets of PIMA 15740, clause 5, field after field; little-endian."""

import struct

from .failures import MalformedError


class DatasetReader:
    """Takes one field after the other.

    Parameters
    ----------
    data
        The whole dataset.
    name
        What messages call it.
    """

    def __init__(self, data: bytes, name: str) -> None:
        self._data = data
        self._name = name
        self._position = 0

    def take(self, size: int) -> bytes:
        """The next `size` bytes.

        Raises
        ------
        MalformedError
            There are fewer, as in everything that follows.
        """
        piece = self._data[self._position : self._position + size]
        if len(piece) < size:
            raise MalformedError(
                f"the camera's {self._name} is cut short: expected {size} bytes from byte "
                f"{self._position} on",
                self._data,
            )
        self._position += size
        return piece

    def numbers(self, layout: str) -> tuple[int, ...]:
        """Numbers in `struct`'s letters."""
        return struct.unpack("<" + layout, self.take(struct.calcsize("<" + layout)))

    def codes(self) -> tuple[int, ...]:
        """An array of u16."""
        (count,) = self.numbers("I")
        return struct.unpack(f"<{count}H", self.take(2 * count))

    def text(self) -> str:
        """A string, without what cannot be printed."""
        units = self.take(2 * self.take(1)[0])
        words = units.decode("utf-16-le", errors="replace").partition("\0")[0]
        return "".join(letter for letter in words if letter.isprintable()).strip()
