"""Provenance of a result: versions of labrig and its libraries, and processing settings."""

from collections import Counter
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from labrig.acquire import ProtocolModel, RigFile
from labrig.analyse import Overrides, chosen_options, options_of
from labrig.foundation.errors import UsageError
from labrig.foundation.input_file import read_text
from labrig.foundation.models import FrozenModel
from labrig.foundation.region import Region
from labrig.foundation.yaml_file import read_model
from labrig.record import (
    DeviceLine,
    RunDescription,
    RunRecord,
    interruptions,
    journal_text,
    read_notes,
    time_text,
)

PROVENANCE = "provenance.yaml"
_LIBRARIES = ("numpy", "scipy", "nlopt", "rawpy", "matplotlib", "colour-science", "h5py")


class Provenance(FrozenModel):
    """Content of `provenance.yaml`; equal provenance gives an equal result.

    Attributes
    ----------
    labrig
        Version of labrig.
    libraries
        Versions of the libraries by name.
    regions
        Regions of the patches by name, as they were used.
    options
        The measurement's own options as they were used, by name.
    camera
        Name of the camera curves with which the report's pictures were coloured.
    frames
        Number of frames used, by role.
    excluded
        Names of the frames that the user excluded.
    optics
        Calibrations that the user named instead of the rig file's.
    journal
        Seal of the run's journal, the SHA-256 of its last line.
    given
        Options of `labrig process` that were given for this result, such as `--states 2`; those of
        an earlier result are not kept.
    """

    labrig: str
    libraries: dict[str, str]
    regions: dict[str, Region]
    options: dict[str, Any]
    camera: str | None
    frames: dict[str, int]
    excluded: tuple[str, ...]
    optics: dict[str, str]
    journal: str
    given: tuple[str, ...] = ()


def provenance(
    run: RunRecord, protocol: Any, overrides: Overrides, camera: str | None
) -> Provenance:
    """Collect the provenance of a result.

    Parameters
    ----------
    run
        Run that is processed.
    protocol
        Protocol of the run.
    overrides
        Settings that replace those of protocol and rig file.
    camera
        Name of the camera curves with which the report's pictures are coloured.
    """
    frames = [frame for attempt in run.completed().values() for frame in attempt.frames]
    patches = hasattr(protocol, "patches")
    return Provenance(
        labrig=version("labrig"),
        libraries=library_versions(),
        regions=overrides.patches(protocol) if patches else dict(overrides.regions),
        options=_options(protocol, overrides),
        camera=camera,
        frames=dict(Counter(frame.role for frame in frames if not overrides.excludes(frame))),
        excluded=tuple(frame.path.name for frame in frames if overrides.excludes(frame)),
        optics=dict(overrides.optics),
        journal=run.seal,
        given=overrides.given(),
    )


def given_before(run: Path) -> list[str]:
    """Return the options that were given for the present result of a run; none without a result."""
    try:
        return list(read_model(run / "result" / PROVENANCE, Provenance).given)
    except UsageError:
        return []


def _options(protocol: Any, overrides: Overrides) -> dict[str, Any]:
    """Return what was given, else what the protocol says, else the default of each option."""
    options: dict[str, Any] = {}
    for model in options_of(protocol):
        by_protocol = {
            name: getattr(protocol, name) for name in model.model_fields if hasattr(protocol, name)
        }
        used = chosen_options(model, overrides.options).model_dump(mode="json")
        for name, value in used.items():
            options[name] = by_protocol.get(name) if value is None else value
    return options


@cache
def library_versions() -> dict[str, str]:
    """Return the versions of the libraries that decode, reduce, fit and draw."""
    import cv2
    import rawpy

    installed = {name: version(name) for name in _LIBRARIES}
    # OpenCV comes as one of several packages, LibRaw inside rawpy.
    libraw = ".".join(map(str, rawpy.libraw_version))
    return {**installed, "opencv": cv2.__version__, "libraw": libraw}


def _text(run: RunRecord, name: str, *, edited: bool) -> str:
    """Return the text of a run's file as its journal has it, or as it was edited since."""
    text = None if edited else journal_text(run.folder, name)
    return read_text(run.folder / name) if text is None else text


def describe_run(
    run: RunRecord, protocol: ProtocolModel, rig: RigFile, *, edited: bool = False
) -> RunDescription:
    """Collect the description of a run from its folder, its protocol and its rig.

    `edited`: these are of the files as they were edited since.
    """
    attempts = list(run.completed().values())
    start = attempts[0].start if attempts else run.attempts[0].start
    identities = start.get("devices", {})
    sample = protocol.sample.model_dump(exclude={"name"}, exclude_none=True)
    return RunDescription(
        title=protocol.sample.name,
        protocol=protocol.protocol,
        run=run.name,
        started=time_text(start["time"]),
        ended=time_text(run.last_time),
        rig=rig.name,
        simulated=rig.simulation is not None,
        labrig_version=version("labrig"),
        libraries=tuple(library_versions().items()),
        sample=tuple((key.replace("_", " "), str(value)) for key, value in sample.items()),
        devices=tuple(
            DeviceLine(role, entry.address, identities.get(role, ""))
            for role, entry in rig.devices.items()
        ),
        guard=start.get("guard", ""),
        protocol_text=_text(run, "protocol.yaml", edited=edited),
        rig_text=_text(run, "rig.yaml", edited=edited),
        interruptions=interruptions(run),
        notes=read_notes(run.folder),
    )
