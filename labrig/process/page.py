"""What the report of a decay run shows."""

from collections.abc import Mapping, Sequence
from importlib.metadata import version

from labrig.acquire import RigFile
from labrig.analyse.choices import DecayProtocol
from labrig.analyse.history import charges_s, interruptions, lamp_sections, written_time
from labrig.analyse.temperature import temperature_sections
from labrig.errors import UsageError
from labrig.fit import DecayFit
from labrig.optics import CameraResponse, read_camera
from labrig.process.provenance import library_versions
from labrig.record import FrameRecord, RunRecord, read_notes
from labrig.region import Region
from labrig.report import DeviceLine, GlowPhotograph, PatchReport, RunReport, figure_style
from labrig.results import Series

#: Photographs of the glow: dense where it changes most.
GLOW_SHARES = (0.0, 0.03, 0.09, 0.22, 0.5, 1.0)


def run_report(
    run: RunRecord,
    protocol: DecayProtocol,
    rig: RigFile,
    patches: Mapping[str, Region],
    series: Mapping[str, Series],
    fits: Mapping[str, DecayFit | str],
    warnings: Sequence[str],
    daylight: Sequence[FrameRecord] = (),
    camera: CameraResponse | None = None,
    states: int | None = None,
) -> RunReport:
    """Gather it all from the run and its results; `states` is what was asked for."""
    attempts = list(run.completed().values())
    first = attempts[0].start
    identities: Mapping[str, str] = first.get("devices", {})
    sample = protocol.sample.model_dump(exclude={"name"}, exclude_none=True)
    with figure_style():
        sections = (*lamp_sections(run), *temperature_sections(run))
    return RunReport(
        title=protocol.sample.name,
        run=run_name(run),
        started=written_time(first["time"]),
        ended=written_time(run.last_time),
        rig=rig.name,
        simulated=rig.simulation is not None,
        labrig_version=version("labrig"),
        patches=tuple(
            PatchReport(name, patches[name], series[name], fit) for name, fit in fits.items()
        ),
        sample=tuple((key.replace("_", " "), str(value)) for key, value in sample.items()),
        devices=tuple(
            DeviceLine(role, entry.address, identities.get(role, ""))
            for role, entry in rig.devices.items()
        ),
        guard=first.get("guard", ""),
        protocol_text=(run.folder / "protocol.yaml").read_text(encoding="utf-8"),
        rig_text=(run.folder / "rig.yaml").read_text(encoding="utf-8"),
        frames=tuple(frame for attempt in attempts for frame in attempt.frames),
        warnings=tuple(warnings),
        daylight=tuple(daylight),
        glow=_glow(run, next(iter(series.values()))),
        camera=camera,
        libraries=tuple(library_versions().items()),
        charges_s=charges_s(run),
        background=protocol.background if protocol.dark == "background" else None,
        states=states,
        interruptions=interruptions(run),
        notes=read_notes(run.folder),
        sections=sections,
        actions=tuple(action for attempt in attempts for action in attempt.actions),
    )


def run_name(run: RunRecord) -> str:
    """The name of its folder, whatever path leads there."""
    return run.folder.resolve().name


def camera_response(rig: RigFile, instead: str | None) -> tuple[CameraResponse | None, list[str]]:
    """The curves asked for `instead`, or the rig's with a warning if they are not here.

    They colour the report's pictures; no number rests on them.
    """
    if instead is not None:
        return read_camera(instead), []
    if rig.optics.camera is None:
        return None, []
    try:
        return read_camera(rig.optics.camera), []
    except UsageError as error:
        return None, [f"colours in the report are the camera's own: {error}"]


def _glow(run: RunRecord, series: Series) -> tuple[GlowPhotograph, ...]:
    """Some photographs of the first decay."""
    frames = {frame.path.name: frame for frame in run.frames("decay")}
    first = series.by_unit()[0]
    last = len(first.frame) - 1
    chosen = sorted({round(share * last) for share in GLOW_SHARES})
    return tuple(GlowPhotograph(frames[first.frame[row]], float(first.t_s[row])) for row in chosen)
