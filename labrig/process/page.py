"""What the report of a decay run shows."""

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from importlib.metadata import version

from labrig.acquire import RigFile
from labrig.fit import DecayFit
from labrig.optics import read_camera
from labrig.process.choices import DecayProtocol
from labrig.record import RunRecord
from labrig.reduce import Series
from labrig.region import Region
from labrig.report import DeviceLine, GlowPhotograph, PatchReport, RunReport

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
) -> RunReport:
    """Gather it all from the run and its results."""
    attempts = list(run.completed().values())
    first = attempts[0].start
    identities: Mapping[str, str] = first.get("devices", {})
    sample = protocol.sample.model_dump(exclude={"name"}, exclude_none=True)
    return RunReport(
        title=protocol.sample.name,
        run=run.folder.name,
        started=_written(first["time"]),
        ended=_written(run.last_time),
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
        protocol_text=(run.folder / "protocol.yaml").read_text(encoding="utf-8"),
        rig_text=(run.folder / "rig.yaml").read_text(encoding="utf-8"),
        frames=tuple(frame for attempt in attempts for frame in attempt.frames),
        warnings=tuple(warnings),
        daylight=tuple(run.frames("daylight")),
        glow=_glow(run, next(iter(series.values()))),
        camera=None if rig.optics.camera is None else read_camera(rig.optics.camera),
    )


def _glow(run: RunRecord, series: Series) -> tuple[GlowPhotograph, ...]:
    """Some photographs of the first decay."""
    frames = {frame.path.name: frame for frame in run.frames("decay")}
    first = series.by_unit()[0]
    last = len(first.frame) - 1
    chosen = sorted({round(share * last) for share in GLOW_SHARES})
    return tuple(GlowPhotograph(frames[first.frame[row]], float(first.t_s[row])) for row in chosen)


def _written(seconds: float) -> str:
    """Seconds since 1970 as a person reads them."""
    return datetime.fromtimestamp(seconds, UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
