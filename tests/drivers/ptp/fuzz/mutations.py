"""Ways in which a PTP container comes to harm on its way."""

import random
from collections import Counter, deque
from collections.abc import Callable

#: Numbers at which sizes, counts and codes go wrong.
EDGES = (0, 1, 7, 8, 11, 12, 13, 255, 256, 511, 512, 0x7FFF, 0xFFFF, 0x10000, 0x400000)
EDGES_32 = (*EDGES, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFE, 0xFFFFFFFF)
#: Bytes of the longest header, parameters included: where a mutation is most telling.
HEADER_BYTES = 18
MAX_GARBAGE_BYTES = 2000
KEPT = 8

Mutation = Callable[[random.Random, bytes], list[bytes]]


def _bits_flipped(rng: random.Random, whole: bytes) -> list[bytes]:
    mutated = bytearray(whole)
    for _ in range(rng.randint(1, 8)):
        mutated[_somewhere(rng, len(whole))] ^= 1 << rng.randrange(8)
    return [bytes(mutated)]


def _number_changed(rng: random.Random, whole: bytes) -> list[bytes]:
    """One u16 or u32 is another: a length, kind, code, id, parameter, count or value."""
    size = rng.choice((2, 4, 4))
    at = _somewhere(rng, max(1, len(whole) - size + 1)) // 2 * 2
    value = rng.choice(EDGES_32) if rng.random() < 0.6 else rng.getrandbits(32)
    number = (value & (1 << 8 * size) - 1).to_bytes(size, "little")
    return [(whole[:at] + number + whole[at + size :])[: len(whole)]]


def _length_changed(rng: random.Random, whole: bytes) -> list[bytes]:
    told = rng.choice((*EDGES_32, len(whole) - 1, len(whole) + 1, len(whole) + 512))
    return [told.to_bytes(4, "little") + whole[4:]]


def _cut_off(rng: random.Random, whole: bytes) -> list[bytes]:
    return [whole[: rng.randrange(len(whole))]]


def _made_longer(rng: random.Random, whole: bytes) -> list[bytes]:
    return [whole + rng.randbytes(rng.choice((1, 4, 12, 512, MAX_GARBAGE_BYTES)))]


def _told_longer_and_made_so(rng: random.Random, whole: bytes) -> list[bytes]:
    more = whole + whole[12:] * rng.randint(1, 40) + rng.randbytes(rng.randint(1, 40))
    return [len(more).to_bytes(4, "little") + more[4:]]


def _garbage(rng: random.Random, whole: bytes) -> list[bytes]:
    return [rng.randbytes(rng.randint(1, MAX_GARBAGE_BYTES))]


def _garbage_before(rng: random.Random, whole: bytes) -> list[bytes]:
    return [rng.randbytes(rng.randint(1, 600)), whole]


def _repeated(rng: random.Random, whole: bytes) -> list[bytes]:
    return [whole] * rng.choice((2, 3, 40))


def _lost(rng: random.Random, whole: bytes) -> list[bytes]:
    return []


MUTATIONS: tuple[Mutation, ...] = (
    _bits_flipped, _number_changed, _number_changed, _length_changed, _cut_off, _made_longer,
    _told_longer_and_made_so, _garbage, _garbage_before, _repeated, _lost,
)  # fmt: skip


def _somewhere(rng: random.Random, size: int) -> int:
    """As often in the header as in all the rest."""
    return rng.randrange(min(size, HEADER_BYTES) if rng.random() < 0.5 else size)


class Mutator:
    """Harms some of what passes one way.

    Parameters
    ----------
    rng
        Decides all.
    fraction
        Of the containers that come to harm; long ones, which are datasets, twice as often.
    """

    def __init__(self, rng: random.Random, fraction: float) -> None:
        self._rng = rng
        self._fraction = fraction
        self._before: deque[bytes] = deque(maxlen=KEPT)
        self._held: bytes | None = None
        self.is_on = True
        self.cases: Counter[str] = Counter()

    def __call__(self, whole: bytes) -> list[bytes]:
        """What becomes of one container: none, itself, or several."""
        out = self._one(whole)
        if self._held is not None and out:
            out, self._held = [*out, self._held], None
        self._before.append(whole)
        return out

    def stop(self) -> None:
        """From now on all passes unharmed."""
        self.is_on = False
        self._held = None

    def _one(self, whole: bytes) -> list[bytes]:
        fraction = self._fraction * (2 if len(whole) > 100 else 1)
        if not self.is_on or self._rng.random() >= fraction:
            return [whole]
        choice = self._rng.randrange(len(MUTATIONS) + 2)
        if choice == len(MUTATIONS) and self._held is None:
            self.cases["swapped with the next"] += 1
            self._held = whole
            return []
        if choice >= len(MUTATIONS):
            self.cases["an earlier one before it"] += 1
            return [self._rng.choice([*self._before, whole]), whole]
        mutation = MUTATIONS[choice]
        self.cases[mutation.__name__.strip("_").replace("_", " ")] += 1
        return mutation(self._rng, whole)
