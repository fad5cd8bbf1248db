"""Measurement of a phosphor's whole material file, by one protocol after the other.

After Nalbach et al., sections 4.2 to 4.7.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from labrig.acquire import (
    SAMPLE_CHANGER,
    PartUnit,
    RigFile,
    Sample,
    Unit,
    driver_and_settings,
    plan,
    planned_rig,
)
from labrig.bench_optics import calibration
from labrig.calibration import REFERENCE_KIND, kinds
from labrig.foundation.errors import ProtocolError
from labrig.foundation.plugins import bench_check, measurement
from labrig.foundation.quantity import duration_text
from labrig.foundation.yaml_file import did_you_mean
from labrig.protocols.steps.bench_configuration import BenchConfiguration, ConfiguredUnit, in_turn
from labrig.protocols.steps.chain import Chain, Part
from labrig.protocols.steps.patch_names import FilterPatches, sample_folders
from labrig.protocols.steps.sample_turns import SampleTurn, in_sample_turns
from labrig.record import PERSON

#: Why samples do not rest while another one is measured.
NOT_DARK = (
    "the rig file does not say that the sample changer keeps samples in the dark, light-tight, "
    "while another one is lit, 'keeps_dark: true' under 'sample_changer:'"
)


def _with_keys(sample: Any) -> Any:
    """Return a sample that is written as its name as one with keys."""
    return sample if isinstance(sample, (dict, Sample)) else {"name": sample}


#: Samples of a changer, by their names there or with all keys of a sample.
ChangerSamples = tuple[
    Annotated[Sample, BeforeValidator(_with_keys, json_schema_input_type=str | Sample)], ...
]


class Phosphor(Chain):
    """Settings of a chain of protocols; `phosphor.yaml` is the commented example.

    Attributes
    ----------
    patches
        Regions of several materials by name: `[x, y, width, height]` in pixels, or all four as
        fractions of the frame, one above the other, each as long as the filter. Their results lie
        in folders of these names. Default: one material.
    samples
        Samples of the sample changer that are all measured, in place of `sample`: their names
        there, or the keys of `sample` for each, for example `[blue-paint, green-paint]`. The bench
        is calibrated or checked once for all of them; their results lie in folders of their names.
    rests
        Whether one sample rests in the dark while another one is measured: `shared`, or `apart`,
        one sample after the other. `auto` is `shared` if the changer keeps samples in the dark
        (`keeps_dark` in the rig file).
    calibrate
        Which parts that calibrate the bench are run: with `as needed` those whose result the rig
        file does not name and no kept calibration has; with `always` all.
    """

    protocol: Literal["phosphor"] = "phosphor"
    patches: FilterPatches = Field(default_factory=dict)
    samples: ChangerSamples = ()
    rests: Literal["auto", "shared", "apart"] = "auto"
    calibrate: Literal["as needed", "always"] = "as needed"

    @model_validator(mode="before")
    @classmethod
    def _called_after_its_samples(cls, content: Any) -> Any:
        """Return the content with all samples' names as that of the sample, for the record."""
        if not isinstance(content, dict) or "sample" in content:
            return content
        samples = content.get("samples")
        if not isinstance(samples, (list, tuple)) or not samples:
            return content
        names = [each.get("name", "") if isinstance(each, dict) else each for each in samples]
        return content | {"sample": {"name": ", ".join(map(str, names))}}

    @model_validator(mode="after")
    def _several_samples(self) -> Self:
        if not self.samples:
            return self
        names = tuple(sample.name for sample in self.samples)
        sample_folders(names)
        if len(names) < 2:
            raise ValueError(f"expected two samples or more in 'samples', got only {names[0]}")
        if self.sample != Sample(name=", ".join(names)):
            raise ValueError("expected either 'sample' or 'samples', got both")
        if self.patches:
            raise ValueError(
                "expected either 'samples' or 'patches', got both: of several materials in one "
                "frame none can rest while another is lit"
            )
        for part in self._links():
            if any(scene.configuration.stage == "lit sample" for scene in part.configured_units()):
                raise ValueError(
                    f"expected parts that leave the samples on their changer, got '{part.name}', "
                    "which has them laid elsewhere by hand; run it with one sample"
                )
        folders = {part.name.casefold() for part in self._links()}
        if clashes := [name for name in names if name.casefold() in folders]:
            raise ValueError(
                f"expected samples that are not called like a part, got '{clashes[0]}': both would "
                "be that folder of the result"
            )
        return self

    @model_validator(mode="after")
    def _patches_beside_parts(self) -> Self:
        folders = {part.name.casefold() for part in self._links()}
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
        kind = keys.get("protocol")
        if not self.patches or not isinstance(kind, str):
            return keys
        if not measurement(kind, f"part {keys.get('part', kind)}").is_per_patch:
            return keys
        patches = keys.get("patches")
        if isinstance(patches, dict) and set(map(str, patches)) != set(self.patches):
            raise ValueError(
                f"part {keys.get('part', keys['protocol'])}: expected the patches of the chain, "
                f"{', '.join(self.patches)}, got {', '.join(map(str, patches)) or 'none'}; leave "
                "'patches:' out of the part, or give them the same names"
            )
        return {"patches": self.patches} | keys

    @property
    def sample_in_place(self) -> str | None:
        """Name of the sample that is in place during the run; None if units bring their own."""
        return None if self.samples else super().sample_in_place

    def chain(self) -> tuple[Part, ...]:
        """Return the protocols in order; of several samples, sample by sample after the bench."""
        links = self._links()
        if not self.samples:
            return links
        own = [part for part in links if part.registered.of == "sample"]
        return (
            *(part for part in links if part.registered.of == "bench"),
            *(part.of_sample(sample) for sample in self.samples for part in own),
        )

    def resolved_for(self, rig: RigFile) -> Self:
        """Return the chain without the parts whose calibrations the rig has, beginning by a check.

        The check compares the bench with that of the calibration; it needs the filter at hand.

        Raises
        ------
        UsageError
            A file that the rig file names does not exist.
        ProtocolError
            The sample changer lacks a sample, or does not keep samples in the dark that are to rest
            there.
        """
        if self.samples:
            rests = self._sharing(rig)
            if rests != self.rests:
                return self.model_copy(update={"rests": rests}).resolved_for(rig)
        if self.calibrate == "always":
            return super().resolved_for(rig)
        known = {kind.protocol for kind in kinds() if rig.optics.named(kind) is not None}
        chain = list(zip(self.parts, self._links(), strict=True))
        kept = [
            (content, part)
            for content, part in chain
            if part.registered.of != "bench" or part.protocol.protocol not in known
        ]
        if not kept:
            return super().resolved_for(rig)
        parts = [content for content, _ in kept]
        registered = [part.registered for _, part in kept]
        reference = calibration(rig, REFERENCE_KIND)
        can_be_checked = reference is not None and reference.picture is not None
        is_needed = any(each.needs_checked_bench for each in registered)
        if can_be_checked and is_needed and not any(each.is_bench_check for each in registered):
            parts.insert(0, {"protocol": bench_check()})
        return super(Phosphor, self.model_copy(update={"parts": tuple(parts)})).resolved_for(rig)

    def _sharing(self, rig: RigFile) -> Literal["shared", "apart"]:
        """Return whether rests are shared on the sample changer of a rig.

        Raises
        ------
        ProtocolError
            There is no changer, it lacks a sample, or it must keep samples in the dark and does
            not.
        """
        source = f"rig '{rig.name}'"
        if SAMPLE_CHANGER.key not in rig.devices:
            raise ProtocolError(
                f"samples: expected a sample changer, the {source} has none; add 'sample_changer:' "
                "under 'devices:', or measure one sample after the other (labrig queue)"
            )
        changer = planned_rig(rig, source, (SAMPLE_CHANGER.key,))[SAMPLE_CHANGER]
        for sample in self.samples:
            if sample.name not in changer.names():
                raise ProtocolError(
                    f"samples: the sample changer of the {source} has no '{sample.name}'; "
                    f"{did_you_mean(sample.name, changer.names())}"
                )
        if self.rests == "shared" and not changer.keeps_dark():
            raise ProtocolError(f"rests: shared is not possible: {NOT_DARK}")
        if self.rests == "auto":
            return "shared" if changer.keeps_dark() else "apart"
        return self.rests

    def notes(self, rig: RigFile) -> Sequence[str]:
        """Return what calibrating takes, why rests are shared, and the time with the other way."""
        if not self.samples:
            return (*super().notes(rig), *self._calibrating(rig))
        _, settings = driver_and_settings(rig, SAMPLE_CHANGER.key, f"rig '{rig.name}'")
        apart = self._lab_time("apart", rig)
        if settings.keeps_dark:
            shared = self._lab_time("shared", rig)
            if self._sharing(rig) == "shared":
                return (
                    f"one sample rests in the dark while another is measured: at most {shared} in "
                    f"the lab, one sample after the other {apart}",
                )
            why = "'rests: apart'"
        else:
            shared = self._lab_time("shared", _with_dark_places(rig))
            why = NOT_DARK
        return (
            f"no sample rests while another is measured ({why}): at most {apart} in the lab, with "
            f"shared rests {shared}",
        )

    def _calibrating(self, rig: RigFile) -> Iterator[str]:
        """Yield how much of the run calibrates the bench, which is needed once for all samples."""
        bench = {
            part.name
            for part in self._links()
            if part.registered.of == "bench" and part.registered.calibration
        }
        if not bench:
            return
        laid_out = plan(self, rig, f"rig '{rig.name}'")
        begins_s = (0.0, *laid_out.unit_ends_s)
        lasts_s = sum(
            end_s - begin_s
            for unit, begin_s, end_s in zip(
                laid_out.units, begins_s, laid_out.unit_ends_s, strict=False
            )
            if unit.partition("/")[0] in bench
        )
        by_hand = sum(
            step.device == PERSON and step.unit.partition("/")[0] in bench
            for step in laid_out.steps
        )
        yield (
            f"{duration_text(lasts_s)} and {by_hand} steps by hand of this run calibrate the "
            "bench: 'labrig run calibration' does so once for all samples, and this run finds it"
        )

    def _lab_time(self, rests: Literal["shared", "apart"], rig: RigFile) -> str:
        """Return the longest time in the lab with rests so, as text."""
        chain = self.model_copy(update={"rests": rests})
        return duration_text(plan(chain, rig, f"rig '{rig.name}'").duration_s)

    def units(self) -> Sequence[Unit]:
        """Return the units of all parts in order; on a checked bench, by configuration."""
        registered = [part.registered for part in self._links()]
        calibrates = any(each.of == "bench" and each.calibration for each in registered)
        is_checked = any(each.is_bench_check for each in registered) and not calibrates
        if self.samples:
            return self._units_of_samples(is_checked=is_checked)
        chain = self.chain()
        if not is_checked:
            return [PartUnit(part.name, unit) for part in chain for unit in part.protocol.units()]
        scenes = sorted(
            ((part, scene) for part in chain for scene in part.configured_units()), key=_turn
        )
        return in_turn(_darks_as_next([scene for _, scene in scenes]))

    def _units_of_samples(self, *, is_checked: bool) -> Sequence[Unit]:
        """Return the units of the bench, then those of all samples."""
        chain = self.chain()
        own: dict[str, list[SampleTurn]] = {}
        for sample in self.samples:
            scenes = [
                (part, scene)
                for part in chain
                if part.sample == sample.name
                for scene in part.configured_units()
            ]
            own[sample.name] = [
                SampleTurn(part.protocol.protocol, scene)
                for part, scene in (sorted(scenes, key=_turn) if is_checked else scenes)
            ]
        of_samples = in_sample_turns(own, shared=self.rests == "shared")
        of_all = [part for part in chain if not part.sample]
        if not is_checked:
            units = [PartUnit(part.name, unit) for part in of_all for unit in part.protocol.units()]
            return [*units, *in_turn(of_samples)]
        check = sorted(
            ((part, scene) for part in of_all for scene in part.configured_units()), key=_turn
        )
        return in_turn(_darks_as_next([*(scene for _, scene in check), *of_samples]))


def _with_dark_places(rig: RigFile) -> RigFile:
    """Return the rig as if its sample changer kept samples in the dark."""
    changer = rig.devices[SAMPLE_CHANGER.key].model_copy(update={"keeps_dark": True})
    return rig.model_copy(update={"devices": {**rig.devices, SAMPLE_CHANGER.key: changer}})


def _darks_as_next(scenes: Sequence[ConfiguredUnit]) -> list[ConfiguredUnit]:
    """Return the scenes with dark frames taken in the configuration of the scene after them."""
    arranged: list[ConfiguredUnit] = []
    for scene in reversed(scenes):
        if scene.is_dark and arranged:
            following = arranged[-1]
            scene = replace(scene, configuration=following.configuration, why=following.why)
        arranged.append(scene)
    return arranged[::-1]


def _turn(scene_of: tuple[Part, ConfiguredUnit]) -> int:
    """Return the place of a part's scene in the order of the bench's configurations.

    The card comes first, while camera and lamp warm up, then dark frames. The sample's own longest
    charge comes last: nothing has to wait until its glow is gone.
    """
    part, scene = scene_of
    wanted = scene.configuration
    if wanted.stage != "sample":
        return 0
    if scene.is_dark and wanted == BenchConfiguration():
        return 1
    if wanted.lvf != "away":
        return 2 if wanted.lvf == "before camera" else 3
    return 4 if part.registered.has_short_charges else 5
