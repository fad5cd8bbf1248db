"""Measurement of a phosphor's whole material file, by one protocol after the other.

After Nalbach et al., sections 4.2 to 4.7.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal, Self

from pydantic import Field, model_validator

from labrig.acquire import PartUnit, ProtocolModel, RigFile, Unit
from labrig.bench_optics import calibration
from labrig.calibration import REFERENCE_KIND, kinds

from .excitation import ExcitationFrames
from .steps.chain import Chain, Part
from .steps.patch_names import FilterPatches
from .steps.scenes import Arrangement, Scene, in_turn

#: Protocols that measure the bench and not the sample.
BENCH = frozenset({"camera_calibration", "blank", "lvf_calibration", "fade", "irradiance"})
#: Protocols that use the variable filter on a sample, and the one that checks the bench for them.
THROUGH_THE_FILTER = frozenset({"emission_spectrum", "excitation"})
CHECK = "calibration_check"
#: Protocols that measure every patch of the chain.
OF_PATCHES = ("emission_spectrum", "decay", "excitation", "saturation", "reflectance")


class Phosphor(Chain):
    """Settings of a chain of protocols; `phosphor.yaml` is the commented example.

    Attributes
    ----------
    patches
        Regions of several materials by name: `[x, y, width, height]` in pixels, or all four as
        fractions of the frame, one above the other, each as long as the filter. Their results lie
        in folders of these names. Default: one material.
    calibrate
        Which parts that calibrate the bench are run: with `as needed` those whose result the rig
        file does not name and no kept calibration has; with `always` all.
    """

    rate_frames = (*ProtocolModel.rate_frames, *ExcitationFrames)

    protocol: Literal["phosphor"] = "phosphor"
    patches: FilterPatches = Field(default_factory=dict)
    calibrate: Literal["as needed", "always"] = "as needed"

    @model_validator(mode="after")
    def _patches_beside_parts(self) -> Self:
        folders = {part.name.casefold() for part in self.chain()}
        if clashes := [name for name in self.patches if name.casefold() in folders]:
            raise ValueError(
                f"expected patches that are not called like a part, got '{clashes[0]}': both would "
                "be that folder of the result"
            )
        return self

    def _part_keys(self, content: Mapping[str, Any]) -> dict[str, Any]:
        """Return the keys of a part with the sample and the patches of the chain.

        Raises
        ------
        ValueError
            The part has other patches than the chain.
        """
        keys = super()._part_keys(content)
        if not self.patches or keys.get("protocol") not in OF_PATCHES:
            return keys
        patches = keys.get("patches")
        if isinstance(patches, dict) and set(map(str, patches)) != set(self.patches):
            raise ValueError(
                f"part {keys.get('part', keys['protocol'])}: expected the patches of the chain, "
                f"{', '.join(self.patches)}, got {', '.join(map(str, patches)) or 'none'}; leave "
                "'patches:' out of the part, or give them the same names"
            )
        return {"patches": self.patches} | keys

    def suited_to(self, rig: RigFile) -> Self:
        """Return the chain without the parts whose calibrations the rig has, beginning by a check.

        The check compares the bench with that of the calibration; it needs the filter at hand.
        """
        if self.calibrate == "always":
            return super().suited_to(rig)
        known = {kind.protocol for kind in kinds() if rig.optics.named(kind) is not None}
        chain = list(zip(self.parts, self.chain(), strict=True))
        kept = [
            (content, part.protocol.protocol)
            for content, part in chain
            if part.protocol.protocol not in BENCH & known
        ]
        if not kept:
            return super().suited_to(rig)
        parts = [content for content, _ in kept]
        names = {name for _, name in kept}
        reference = calibration(rig, REFERENCE_KIND)
        can_be_checked = reference is not None and reference.picture is not None
        if can_be_checked and names & THROUGH_THE_FILTER and CHECK not in names:
            parts.insert(0, {"protocol": CHECK})
        return super(Phosphor, self.model_copy(update={"parts": tuple(parts)})).suited_to(rig)

    def units(self) -> Sequence[Unit]:
        """Return the units of all parts in order; on a checked bench, by arrangement."""
        chain = self.chain()
        protocols = {part.protocol.protocol for part in chain}
        if CHECK not in protocols or BENCH & protocols:
            return [PartUnit(part.name, unit) for part in chain for unit in part.protocol.units()]
        scenes = sorted(((part, scene) for part in chain for scene in part.scenes()), key=_turn)
        return in_turn(_darks_as_next([scene for _, scene in scenes]))


def _darks_as_next(scenes: Sequence[Scene]) -> list[Scene]:
    """Return the scenes with dark frames taken in the arrangement of the scene after them."""
    arranged: list[Scene] = []
    for scene in reversed(scenes):
        if scene.is_dark and arranged:
            following = arranged[-1]
            scene = replace(scene, arrangement=following.arrangement, why=following.why)
        arranged.append(scene)
    return arranged[::-1]


def _turn(scene_of: tuple[Part, Scene]) -> int:
    """Return the place of a part's scene in the order of the bench's arrangements.

    The card comes first, while camera and lamp warm up, then dark frames. The sample's own longest
    charge comes last: nothing has to wait until its glow is gone.
    """
    part, scene = scene_of
    wanted = scene.arrangement
    if wanted.stage != "sample":
        return 0
    if scene.is_dark and wanted == Arrangement():
        return 1
    if wanted.lvf != "away":
        return 2 if wanted.lvf == "before camera" else 3
    return 4 if part.protocol.protocol == "excitation" else 5
