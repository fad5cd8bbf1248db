"""Variants of a protocol that differ in a key or two."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from labrig.acquire import CameraCapabilities, ProtocolModel
from labrig.foundation.quantity import duration_text
from labrig.foundation.region import Region
from labrig.protocols.steps.decays import DecaySettings

#: Factor of the number of decays that halves uncorrelated noise.
REPEATS = 4

Keys = Mapping[str, Any]


@dataclass(frozen=True)
class Change:
    """Values for some keys of a protocol.

    Attributes
    ----------
    description
        Description of the change.
    keys
        Keys with their values, as in the protocol file.
    """

    description: str
    keys: Keys

    def __and__(self, other: "Change") -> "Change":
        return Change(f"{self.description}, {other.description}", _merged(self.keys, other.keys))

    def contradicts(self, other: "Change") -> bool:
        """Whether both changes set the same key."""
        return bool(_leaves(self.keys) & _leaves(other.keys))


def changed(protocol: ProtocolModel, keys: Keys) -> ProtocolModel:
    """Return a protocol with other values for some keys, validated as if read from a file.

    Raises
    ------
    pydantic.ValidationError
        If the values do not fit the protocol.
    """
    content = _merged(protocol.model_dump(mode="json", by_alias=True), keys)
    return type(protocol).model_validate(content)


def changes(
    protocol: DecaySettings, capabilities: CameraCapabilities, patches: Iterable[str]
) -> Iterator[Change]:
    """Yield changes that may determine the rates of `patches` better, one key at a time."""
    if isinstance(protocol.exposure, float):
        yield Change("exposure: auto", {"exposure": "auto"})
    if protocol.exposure != "grow":
        yield Change("exposure: grow", {"exposure": "grow"})
    repeats = REPEATS * protocol.repeats
    yield Change(f"repeats: {repeats}", {"repeats": repeats})
    for key, seconds in (
        ("for", 2 * protocol.duration),
        ("every", protocol.every / 2),
        ("every", protocol.every * 2),
    ):
        yield Change(f"{key}: {duration_text(seconds)}", {key: f"{seconds!r} s"})
    for iso in _neighbours(capabilities.isos, protocol.camera.iso):
        yield Change(f"iso: {iso}", {"camera": {"iso": iso}})
    f_number = protocol.camera.f_number
    for wider in [offered for offered in capabilities.f_numbers if f_number and offered < f_number][
        -1:
    ]:
        yield Change(f"f_number: {wider:g}", {"camera": {"f_number": wider}})
    larger = {patch: _twice_the_area(protocol.patches[patch]) for patch in patches}
    yield Change("patch of twice the area", {"patches": larger})


def _merged(base: Keys, overrides: Keys) -> dict[str, Any]:
    """Return `base` with the values of `overrides`, also within one level of nesting."""
    merged = dict(base)
    for key, value in overrides.items():
        both = isinstance(value, Mapping) and isinstance(merged.get(key), Mapping)
        merged[key] = {**merged[key], **value} if both else value
    return merged


def _leaves(keys: Keys) -> set[tuple[str, str]]:
    return {
        (key, inner)
        for key, value in keys.items()
        for inner in (value if isinstance(value, Mapping) else [""])
    }


def _neighbours(offered: tuple[int, ...], value: int) -> list[int]:
    """Return the offered values next below and above `value`."""
    pairs = [pair for pair in pairwise(offered) if value in pair]
    return [low if high == value else high for low, high in pairs]


def _twice_the_area(region: Region) -> tuple[float, ...]:
    """Return a region grown about its centre, in whole pixels if it was in pixels."""
    x, y, width, height = region
    wider, higher = width * 2**0.5, height * 2**0.5
    grown = (x - (wider - width) / 2, y - (higher - height) / 2, wider, higher)
    return grown if max(region) <= 1 else tuple(float(round(number)) for number in grown)
