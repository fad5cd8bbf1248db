"""All that a phosphor's material file holds, in one afternoon: one protocol after the other.

After Nalbach et al., sections 4.2 to 4.7.
"""

from collections.abc import Sequence
from typing import Any, Literal, Self

from pydantic import Field, model_validator

from labrig.acquire import PartUnit, ProtocolModel, Unit, plugins
from labrig.yaml_file import validate


class Phosphor(ProtocolModel):
    """The chain; see `phosphor.yaml` for what each key means."""

    protocol: Literal["phosphor"] = "phosphor"
    parts: tuple[dict[str, Any], ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _parts_that_can_be_told_apart(self) -> Self:
        names = [part.name for part in self.chain()]
        if len(set(names)) < len(names):
            raise ValueError(
                f"expected every protocol once in 'parts', got {', '.join(names)}; give one of "
                "two alike a 'part:' name of its own"
            )
        return self

    def chain(self) -> tuple["Part", ...]:
        """The protocols in order, each with the sample of the chain."""
        return tuple(Part.read(content, self) for content in self.parts)

    def units(self) -> Sequence[Unit]:
        """Those of all parts, in order."""
        return [
            PartUnit(part.name, unit) for part in self.chain() for unit in part.protocol.units()
        ]


class Part:
    """One protocol of the chain."""

    def __init__(self, name: str, protocol: ProtocolModel) -> None:
        self.name = name
        self.protocol = protocol

    @classmethod
    def read(cls, content: dict[str, Any], chain: ProtocolModel) -> Self:
        """A protocol written as in a file of its own.

        Raises
        ------
        ValueError
            It names no protocol that may be a part.
        """
        keys = dict(content)
        kind = keys.get("protocol")
        if not isinstance(kind, str) or kind == chain.protocol:
            raise ValueError("expected 'protocol: NAME' in every part, the name of another one")
        name = str(keys.pop("part", kind))
        keys.setdefault("sample", chain.sample.model_dump(exclude_none=True))
        model = plugins.load(plugins.PROTOCOLS, kind, f"part {name}")
        return cls(name, validate(keys, model, f"part {name}"))
