"""Settings of a run's processing: those of its protocol, and the user's instead."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, Self

from labrig.acquire import EDITED, Optics, ProtocolModel, RigFile, read_run_protocol, read_run_rig
from labrig.analyse.process_options import flag
from labrig.foundation.errors import UsageError
from labrig.foundation.named_files import with_absolute_paths
from labrig.foundation.region import Region, parse_region
from labrig.foundation.yaml_file import did_you_mean
from labrig.record import FileRecord

#: Options each of whose values is another one: a patch, a frame, a key of the rig file.
_REPEATABLE = {"--roi", "--exclude", "--optics"}


@dataclass(frozen=True)
class Overrides:
    """The user's settings that replace the protocol's.

    Attributes
    ----------
    regions
        Region of each patch by its name; the name "" stands for the only patch there is.
    excluded
        Frames to leave out, by file name or number.
    camera
        Camera curves for the report's colours instead of the rig file's.
    optics
        Keys of the rig file's `optics:` to replace: calibrations that were made later.
    options
        The measurement's own options by name, such as `states` of a decay.
    edited
        Whether protocol and rig are those of the files as they are now, instead of the journal's.
    """

    regions: Mapping[str, Region] = field(default_factory=dict)
    excluded: frozenset[str] = frozenset()
    camera: str | None = None
    optics: Mapping[str, str] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)
    edited: bool = False

    @classmethod
    def parse(
        cls,
        regions: Sequence[str],
        excluded: Sequence[str],
        camera: str | None = None,
        optics: Sequence[str] = (),
        options: Mapping[str, Any] = MappingProxyType({}),
    ) -> Self:
        """Parse the texts of a command line.

        Parameters
        ----------
        regions
            Regions as `NAME=x,y,w,h` or `x,y,w,h`.
        excluded
            Numbers or names of frames.
        camera
            Camera curves.
        optics
            Calibrations as `KEY=PATH` of the rig file's `optics:`.
        options
            The measurement's own options by name.

        Raises
        ------
        UsageError
            A region or a calibration is malformed.
        """
        named = {}
        for text in regions:
            name, _, numbers = text.rpartition("=")
            named[name] = parse_region(numbers)
        return cls(
            named,
            frozenset(excluded),
            camera,
            dict(_parse_calibration(text) for text in optics),
            dict(options),
        )

    def given(self) -> tuple[str, ...]:
        """Return what was given as options of a command line, such as `--states 2`."""
        regions = {
            f"{name}=" if name else "": ",".join(f"{each:g}" for each in region)
            for name, region in self.regions.items()
        }
        texts = [f"--roi {name}{region}" for name, region in regions.items()]
        texts += [f"--exclude {name}" for name in sorted(self.excluded)]
        texts += [] if self.camera is None else [f"--camera {self.camera}"]
        texts += [f"--optics {key}={path}" for key, path in self.optics.items()]
        for name, value in self.options.items():
            if isinstance(value, list | tuple):
                texts += [f"{flag(name)} {each}" for each in value]
            elif value is not None and value is not False:
                texts.append(flag(name) if value is True else f"{flag(name)} {value}")
        return (*texts, EDITED) if self.edited else tuple(texts)

    def not_kept(self, before: Sequence[str]) -> list[str]:
        """Return the options among those given before that are neither given again nor replaced."""
        now = self.given()
        flags = {text.split()[0] for text in now} - _REPEATABLE
        keys = set(map(_key, now))
        return [text for text in before if text.split()[0] not in flags and _key(text) not in keys]

    def protocol(self, run: Path) -> ProtocolModel:
        """Return the protocol of a run.

        Raises
        ------
        UsageError
            This is no run folder, or the protocol is malformed.
        """
        return read_run_protocol(run, edited=self.edited)

    def bench(self, run: Path) -> RigFile:
        """Return the rig of a run as it was, with the user's calibrations instead.

        Raises
        ------
        UsageError
            The rig file in the run folder is malformed.
        """
        rig = read_run_rig(run, edited=self.edited)
        return rig.model_copy(update={"optics": rig.optics.model_copy(update=dict(self.optics))})

    def patches(self, protocol: Any) -> dict[str, Region]:
        """Return the patches of a protocol, with the user's regions instead.

        Raises
        ------
        UsageError
            There is no patch of that name.
        """
        patches = dict(protocol.patches)
        for name, region in self.regions.items():
            if not name and len(patches) == 1:
                name = next(iter(patches))
            if name not in patches:
                raise UsageError(
                    f"--roi: no patch is called '{name}'; {did_you_mean(name, list(patches))}; "
                    "write --roi NAME=x,y,width,height"
                )
            patches[name] = region
        return patches

    def excludes(self, frame: FileRecord) -> bool:
        """Return whether `frame` is to be left out."""
        return bool(self.excluded & _names(frame))

    def check(self, frames: Sequence[FileRecord]) -> None:
        """Refuse to exclude frames that the run does not have.

        Raises
        ------
        UsageError
            Frames are not in the run; the message names them.
        """
        unknown = self.excluded.difference(*(_names(frame) for frame in frames))
        if unknown:
            there = f"; it has {frames[0].path.name} to {frames[-1].path.name}" if frames else ""
            raise UsageError(
                f"--exclude: the run has no frame {', '.join(sorted(unknown))}{there}; give one by "
                "its number or name, and repeat the option for several"
            )


def _key(option: str) -> str:
    """Return the part of an option that names what it is about: its flag, a patch, a frame."""
    key, is_named, _ = option.partition("=")
    return "--roi" if key.startswith("--roi ") and not is_named else key


def _parse_calibration(text: str) -> tuple[str, str]:
    """Return key and absolute path of a calibration."""
    key, _, named = text.partition("=")
    if key not in Optics.model_fields or not named:
        is_known = key in Optics.model_fields
        hint = f"such as {key}=PATH" if is_known else did_you_mean(key, list(Optics.model_fields))
        raise UsageError(
            f"--optics: expected KEY=PATH with a key of 'optics:' in a rig file, got '{text}'; "
            f"{hint}"
        )
    return key, with_absolute_paths({key: named}, Optics, Path.cwd())[key]


def _names(frame: FileRecord) -> set[str]:
    return {frame.path.name, frame.path.stem, frame.path.stem.lstrip("0")}
