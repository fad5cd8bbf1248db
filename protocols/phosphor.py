"""Measurement of a phosphor's whole material file, by one protocol after the other.

After Nalbach et al., sections 4.2 to 4.7.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Literal, Self

from pydantic import Field, model_validator

from labrig import plugins
from labrig.acquire import PartUnit, ProtocolModel, RigFile, Unit
from labrig.record import unit_within
from labrig.region import Region
from labrig.yaml_file import validate

from .excitation import ExcitationFrames
from .steps.patch_names import FilterPatches

#: Protocols that measure every patch of the chain.
OF_PATCHES = ("emission_spectrum", "decay", "excitation", "saturation", "reflectance")


class Phosphor(ProtocolModel):
    """Settings of a chain of protocols; `phosphor.yaml` is the commented example.

    Attributes
    ----------
    patches
        Regions of several materials by name: `[x, y, width, height]` in pixels, or all four as
        fractions of the frame, one above the other, each as long as the filter. Their results lie
        in folders of these names. Default: one material.
    parts
        Protocols of the chain in order, each written as in a file of its own. `part: NAME` is a
        name for one of two parts with the same protocol.
    """

    rate_frames = (*ProtocolModel.rate_frames, *ExcitationFrames)

    protocol: Literal["phosphor"] = "phosphor"
    patches: FilterPatches = Field(default_factory=dict)
    parts: tuple[dict[str, Any], ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _parts_that_can_be_told_apart(self) -> Self:
        names = [part.name for part in self.chain()]
        if len(set(names)) < len(names):
            raise ValueError(
                f"expected every protocol once in 'parts', got {', '.join(names)}; give one of "
                "two alike a 'part:' name of its own"
            )
        folders = {name.casefold() for name in names}
        if clashes := [name for name in self.patches if name.casefold() in folders]:
            raise ValueError(
                f"expected patches that are not called like a part, got '{clashes[0]}': both would "
                "be that folder of the result"
            )
        return self

    def chain(self) -> tuple["Part", ...]:
        """Return the protocols in order, each with the sample and the patches of the chain."""
        return tuple(Part.read(content, self) for content in self.parts)

    def patches_of(self, unit: str) -> Mapping[str, Region]:
        """Return the patches of the part to which the unit belongs."""
        for part in self.chain():
            if (part_unit := unit_within(part.name, unit)) is not None:
                return part.protocol.patches_of(part_unit)
        return self.patches

    def named_regions(self) -> Mapping[str, Region]:
        """Return the regions of all parts; those that a part shares with the chain stand once."""
        regions = dict(super().named_regions())
        for part in self.chain():
            for key, region in part.protocol.named_regions().items():
                if regions.get(key) != region:
                    regions[f"{part.name}: {key}"] = region
        return regions

    def suited_to(self, rig: RigFile) -> Self:
        """Return the chain with the keys filled in that its parts leave to the rig file."""
        parts = [
            content | _changed(part.protocol, part.protocol.suited_to(rig))
            for content, part in zip(self.parts, self.chain(), strict=True)
        ]
        return self.model_copy(update={"parts": tuple(parts)})

    def unmeasured(self, rig: RigFile) -> Sequence[str]:
        """Return the protocols that neither the rig file names nor an earlier part measures."""
        measured: set[str] = set()
        missing: list[str] = []
        for part in self.chain():
            missing += [name for name in part.protocol.unmeasured(rig) if name not in measured]
            measured.add(part.protocol.protocol)
        return missing

    def units(self) -> Sequence[Unit]:
        """Return the units of all parts, in order."""
        return [
            PartUnit(part.name, unit) for part in self.chain() for unit in part.protocol.units()
        ]


class Part:
    """One protocol of the chain."""

    def __init__(self, name: str, protocol: ProtocolModel) -> None:
        self.name = name
        self.protocol = protocol

    @classmethod
    def read(cls, content: dict[str, Any], chain: Phosphor) -> Self:
        """Return a protocol that is written as in a file of its own.

        Raises
        ------
        ValueError
            The content names no protocol that may be a part, or other patches than the chain.
        """
        keys = dict(content)
        kind = keys.get("protocol")
        if not isinstance(kind, str) or kind == chain.protocol:
            raise ValueError("expected 'protocol: NAME' in every part, the name of another one")
        name = str(keys.pop("part", kind))
        keys.setdefault("sample", chain.sample.model_dump(exclude_none=True))
        if chain.patches and kind in OF_PATCHES:
            patches = keys.get("patches")
            if patches is None:
                keys["patches"] = chain.patches
            elif isinstance(patches, dict) and set(map(str, patches)) != set(chain.patches):
                raise ValueError(
                    f"part {name}: expected the patches of the chain, {', '.join(chain.patches)}, "
                    f"got {', '.join(map(str, patches)) or 'none'}; leave 'patches:' out of the "
                    "part, or give them the same names"
                )
        model = plugins.load(plugins.PROTOCOLS, kind, f"part {name}")
        return cls(name, validate(keys, model, f"part {name}"))


def _changed(original: ProtocolModel, completed: ProtocolModel) -> dict[str, Any]:
    """Return the keys, as written in YAML, that differ between two protocols."""
    original_keys = original.model_dump(mode="json", by_alias=True)
    completed_keys = completed.model_dump(mode="json", by_alias=True)
    return {key: value for key, value in completed_keys.items() if value != original_keys[key]}
