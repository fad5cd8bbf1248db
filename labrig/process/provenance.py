"""Provenance of a result: versions of labrig and its libraries, and processing settings."""

from collections import Counter
from functools import cache
from importlib.metadata import version
from typing import Any

from labrig.acquire import ProtocolModel, RigFile
from labrig.analyse import Overrides
from labrig.foundation.input_file import read_text
from labrig.foundation.models import FrozenModel
from labrig.foundation.region import Region
from labrig.record import (
    DeviceLine,
    RunDescription,
    RunRecord,
    interruptions,
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
    states
        Number of states that was fitted, or `auto`.
    method
        Method of estimating re-radiation; null for protocols that have none.
    fixed_rates_per_s
        Rates in 1/s that the user held fixed.
    law
        Law of decay that the user asked for, or `auto`.
    order
        Kinetic order of excitation that the user asked for, `free` or `auto`.
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
    """

    labrig: str
    libraries: dict[str, str]
    regions: dict[str, Region]
    states: str | int
    method: str | None
    fixed_rates_per_s: tuple[float, ...]
    law: str
    order: str
    camera: str | None
    frames: dict[str, int]
    excluded: tuple[str, ...]
    optics: dict[str, str]
    journal: str


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
        states=overrides.states or getattr(protocol, "states", "auto"),
        method=overrides.method or getattr(protocol, "method", None),
        fixed_rates_per_s=overrides.fixed_rates_per_s,
        law=overrides.law,
        order=overrides.order,
        camera=camera,
        frames=dict(Counter(frame.role for frame in frames if not overrides.excludes(frame))),
        excluded=tuple(frame.path.name for frame in frames if overrides.excludes(frame)),
        optics=dict(overrides.optics),
        journal=run.seal,
    )


@cache
def library_versions() -> dict[str, str]:
    """Return the versions of the libraries that decode, reduce, fit and draw."""
    import cv2
    import rawpy

    installed = {name: version(name) for name in _LIBRARIES}
    # OpenCV comes as one of several packages, LibRaw inside rawpy.
    libraw = ".".join(map(str, rawpy.libraw_version))
    return {**installed, "opencv": cv2.__version__, "libraw": libraw}


def describe_run(run: RunRecord, protocol: ProtocolModel, rig: RigFile) -> RunDescription:
    """Collect the description of a run from its folder, its protocol and its rig."""
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
        protocol_text=read_text(run.folder / "protocol.yaml"),
        rig_text=read_text(run.folder / "rig.yaml"),
        interruptions=interruptions(run),
        notes=read_notes(run.folder),
    )
