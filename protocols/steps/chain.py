"""A chain of protocols in one run, whose parts are written as in files of their own."""

from collections.abc import Collection, Mapping, Sequence, Set
from dataclasses import replace
from typing import Any, Self

from pydantic import Field, model_validator

from labrig.acquire import (
    Adaptation,
    CameraCapabilities,
    PartUnit,
    ProtocolModel,
    Rig,
    RigFile,
    Sample,
)
from labrig.foundation.errors import ProtocolError
from labrig.foundation.plugins import Measurement, measurement
from labrig.foundation.region import Region
from labrig.foundation.yaml_file import validate
from labrig.record import FrameRole, unit_in, unit_within

from .bench_configuration import BenchConfiguration, ConfiguredProtocol, ConfiguredUnit

ANOTHER = "expected 'protocol: NAME' in every part, the name of another one that is no chain"


class Chain(ProtocolModel):
    """Base of protocols that run others one after the other.

    Attributes
    ----------
    parts
        Protocols of the chain in order, each written as in a file of its own. `part: NAME` is a
        name for one of two parts with the same protocol.
    """

    parts: tuple[dict[str, Any], ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _parts_that_can_be_told_apart(self) -> Self:
        names = [part.name for part in self._links()]
        if len(set(names)) < len(names):
            raise ValueError(
                f"expected every protocol once in 'parts', got {', '.join(names)}; give one of "
                "two alike a 'part:' name of its own"
            )
        return self

    def chain(self) -> tuple["Part", ...]:
        """Return the protocols in order, each with the sample of the chain."""
        return self._links()

    def _links(self) -> tuple["Part", ...]:
        """Return a protocol for each entry of `parts`, in order."""
        return tuple(Part.read(self._part_keys(content), self.protocol) for content in self.parts)

    def _part_keys(self, content: Mapping[str, Any]) -> dict[str, Any]:
        """Return the keys of a part with those that it takes from the chain."""
        sample = self.sample.model_dump(exclude_none=True)
        return {"sample": sample} | dict(content)

    @property
    def rate_frames(self) -> Collection[str]:
        """Roles of the frames to which rates are fitted in any part."""
        return tuple({role: None for part in self._links() for role in part.protocol.rate_frames})

    @property
    def picture_frames(self) -> Collection[str]:
        """Roles of the frames that show the sample in any part, its decay first."""
        roles = {role: None for part in self._links() for role in part.protocol.picture_frames}
        return sorted(roles, key=lambda role: role != FrameRole.DECAY)

    def patches_of(self, unit: str) -> Mapping[str, Region]:
        """Return the patches of the part to which the unit belongs."""
        for part in self.chain():
            if (part_unit := unit_within(part.name, unit)) is not None:
                return part.protocol.patches_of(part_unit)
        return super().patches_of(unit)

    def apertures(self) -> Set[float]:
        """Return the f-numbers of the frames of all parts."""
        return {f_number for part in self.chain() for f_number in part.protocol.apertures()}

    def named_regions(self) -> Mapping[str, Region]:
        """Return the regions of all parts; those that a part shares with the chain stand once."""
        regions = dict(super().named_regions())
        for part in self.chain():
            for key, region in part.protocol.named_regions().items():
                if regions.get(key) != region:
                    regions[f"{part.name}: {key}"] = region
        return regions

    def resolved_for(self, rig: RigFile) -> Self:
        """Return the chain with the keys filled in that its parts leave to the rig file."""
        parts = [
            content | _changed(part.protocol, part.protocol.resolved_for(rig))
            for content, part in zip(self.parts, self._links(), strict=True)
        ]
        return self.model_copy(update={"parts": tuple(parts)})

    def adapted_to(
        self, rig: Rig, chosen: Collection[str] | None = None
    ) -> tuple[Self, Sequence[Adaptation]]:
        """Return the chain with the values of its parts among those of a rig; and which.

        Parameters
        ----------
        rig
            Open devices, or stand-ins of a plan.
        chosen
            Keys of the chain whose values a person chose; None: those that its file sets, and all
            keys of its parts there.

        Raises
        ------
        ProtocolError
            The rig does not offer a value that was chosen; the message names the part.
        """
        in_parts = None if chosen is None or "parts" in chosen else ()
        parts, adaptations = [], []
        for content, part in zip(self.parts, self._links(), strict=True):
            try:
                protocol, changes = part.protocol.adapted_to(rig, in_parts)
            except ProtocolError as error:
                error.args = (f"part {part.name}: {error}",)
                raise
            parts.append(content | _changed(part.protocol, protocol))
            adaptations += [replace(each, key=f"{part.name}: {each.key}") for each in changes]
        if not adaptations:
            return self, ()
        return self.model_copy(update={"parts": tuple(parts)}), adaptations

    def frame_spacing(self, capabilities: CameraCapabilities) -> Sequence[str]:
        """Return the parts whose frames are spaced alike, and how, in lines for a plan."""
        parts: dict[tuple[str, ...], list[str]] = {}
        for part in self._links():
            if lines := tuple(part.protocol.frame_spacing(capabilities)):
                parts.setdefault(lines, []).append(part.name)
        return [
            text
            for (first, *others), names in parts.items()
            for text in (f"{', '.join(names)}: {first}", *others)
        ]

    def unnamed_curves(self, rig: RigFile) -> Mapping[str, Sequence[str]]:
        """Return the curves that any part needs and the rig file does not name, with the parts."""
        needed: dict[str, list[str]] = {}
        for part in self._links():
            for key in part.protocol.unnamed_curves(rig):
                needed.setdefault(key, []).append(part.name)
        return needed

    def unmeasured(self, rig: RigFile) -> Sequence[str]:
        """Return the protocols that neither the rig file names nor an earlier part measures."""
        measured: set[str] = set()
        missing: list[str] = []
        for part in self.chain():
            missing += [name for name in part.protocol.unmeasured(rig) if name not in measured]
            measured.add(part.protocol.protocol)
        return missing


class Part:
    """One protocol of a chain.

    Attributes
    ----------
    name
        Name of the part in the chain, which its units begin with.
    protocol
        Model of the protocol.
    registered
        Registration of its measurement.
    sample
        Name of the sample that alone it measures; empty for the only one, and for the bench.
    """

    def __init__(
        self, name: str, protocol: ProtocolModel, registered: Measurement, sample: str = ""
    ) -> None:
        self.name = name
        self.protocol = protocol
        self.registered = registered
        self.sample = sample

    def of_sample(self, sample: Sample) -> "Part":
        """Return the part for one of several samples, which its name begins with."""
        protocol = self.protocol.model_copy(update={"sample": sample})
        return Part(unit_in(sample.name, self.name), protocol, self.registered, sample.name)

    @classmethod
    def read(cls, content: Mapping[str, Any], chain: str) -> Self:
        """Return a protocol that is written as in a file of its own.

        Raises
        ------
        ValueError
            The content names no protocol that may be a part of the chain of that name.
        """
        keys = dict(content)
        kind = keys.get("protocol")
        if not isinstance(kind, str) or kind == chain:
            raise ValueError(ANOTHER)
        name = str(keys.pop("part", kind))
        registered = measurement(kind, f"part {name}")
        model = registered.load("protocol")
        if issubclass(model, Chain):
            raise ValueError(ANOTHER)
        return cls(name, validate(keys, model, f"part {name}"), registered)

    def configured_units(self) -> list[ConfiguredUnit]:
        """Return the part's scenes, with the names that its units have in the chain.

        Of a protocol without scenes all units want the bench as usual, and put it back.
        """
        protocol = self.protocol
        if isinstance(protocol, ConfiguredProtocol):
            return [scene.of_part(self.name) for scene in protocol.configured_units()]
        why = f"{self.name} begins so"
        return [
            ConfiguredUnit(PartUnit(self.name, unit), BenchConfiguration(), why)
            for unit in protocol.units()
        ]


def _changed(original: ProtocolModel, completed: ProtocolModel) -> dict[str, Any]:
    """Return the keys, as written in YAML, that differ between two protocols."""
    original_keys = original.model_dump(mode="json", by_alias=True)
    completed_keys = completed.model_dump(mode="json", by_alias=True)
    return {key: value for key, value in completed_keys.items() if value != original_keys[key]}
