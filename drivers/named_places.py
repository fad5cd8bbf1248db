"""Devices that bring one of several named things into a place: filters of a wheel, samples."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Generic, Protocol, TypeVar

Position = TypeVar("Position")


class NamedPlaces(ABC, Generic[Position]):
    """Positions by the names of things, and one with nothing.

    Parameters
    ----------
    positions
        Position with each thing in place, by its name.
    empty
        Position with none of them in place.
    """

    def __init__(self, positions: Mapping[str, Position], empty: Position) -> None:
        self._positions = positions
        self._empty = empty

    @abstractmethod
    def _move(self, position: Position) -> None:
        """Move; return when the position is reached."""

    def put(self, name: str | None) -> None:
        """Bring a thing, or for None nothing, into place; return when it is there.

        Raises
        ------
        UnclearAnswerError
            The device does not confirm it.
        """
        self._move(self._empty if name is None else self._positions[name])


class _NamesFilters(Protocol):
    @property
    def filters(self) -> Mapping[str, object]: ...


class FilterPlaces(NamedPlaces[Position]):
    """Filters of a wheel or slide, as the rig file names them."""

    @classmethod
    def declared_filters(cls, settings: _NamesFilters) -> Sequence[str]:
        """Return the filters that the rig file names."""
        return tuple(settings.filters)

    def filters(self) -> tuple[str, ...]:
        """Return the names of the filters in the wheel."""
        return tuple(self._positions)


class _NamesSamples(Protocol):
    @property
    def samples(self) -> Mapping[str, object]: ...

    @property
    def keeps_dark(self) -> bool: ...


class SamplePlaces(NamedPlaces[Position]):
    """Samples of a changer, as the rig file names them."""

    _keeps_dark: bool

    @classmethod
    def declared_keeps_dark(cls, settings: _NamesSamples) -> bool:
        """Whether the rig file says that samples that are not in place lie in the dark."""
        return settings.keeps_dark

    def keeps_dark(self) -> bool:
        """Whether samples that are not in place lie in the dark while another one is lit."""
        return self._keeps_dark

    @classmethod
    def declared_samples(cls, settings: _NamesSamples) -> Sequence[str]:
        """Return the samples that the rig file names."""
        return tuple(settings.samples)

    def samples(self) -> tuple[str, ...]:
        """Return the names of the samples on the changer."""
        return tuple(self._positions)
