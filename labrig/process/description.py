"""What is known of a run besides what it measured."""

from importlib.metadata import version

from labrig.acquire import ProtocolModel, RigFile
from labrig.process.provenance import library_versions
from labrig.record import (
    DeviceLine,
    RunDescription,
    RunRecord,
    interruptions,
    read_notes,
    written_time,
)


def describe_run(run: RunRecord, protocol: ProtocolModel, rig: RigFile) -> RunDescription:
    """Gather it from the run folder, and from what processes it."""
    attempts = list(run.completed().values())
    start = attempts[0].start if attempts else run.attempts[0].start
    identities = start.get("devices", {})
    sample = protocol.sample.model_dump(exclude={"name"}, exclude_none=True)
    return RunDescription(
        title=protocol.sample.name,
        protocol=protocol.protocol,
        run=run.name,
        started=written_time(start["time"]),
        ended=written_time(run.last_time),
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
        protocol_text=(run.folder / "protocol.yaml").read_text(encoding="utf-8"),
        rig_text=(run.folder / "rig.yaml").read_text(encoding="utf-8"),
        interruptions=interruptions(run),
        notes=read_notes(run.folder),
    )
