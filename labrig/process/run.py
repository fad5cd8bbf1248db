"""A run of any protocol, from its folder to its result."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

from labrig.acquire import ProtocolModel, RigFile, plugins
from labrig.process.choices import Choices, read_run_protocol
from labrig.process.decay import process_decay
from labrig.process.history import interruptions, lamp_sections, written_time
from labrig.process.known import Known
from labrig.process.provenance import StageProvenance, library_versions
from labrig.process.result import Result
from labrig.process.result_folder import new_result, put_in_place, write_provenance
from labrig.process.stage import Stage, StageResult
from labrig.process.temperature import temperature_sections, temperature_warnings
from labrig.record import Attempt, RunRecord, read_notes, read_run
from labrig.report import DeviceLine, StagePage, figure_style, write_stage_page
from labrig.report.sections import Section
from labrig.report.timing import moves_text


def process_run(folder: Path, choices: Choices | None = None) -> Result:
    """Reduce and fit the run in `folder`, write `result/` and the report in it.

    A `result` that comes out any different from the one before takes its place; that one is kept
    as `result-1`, `result-2`, …

    Raises
    ------
    UsageError
        Not a run folder, or a choice that does not fit it.
    DataError
        What there is does not suffice, or a frame is missing or was changed after the run.
    FitError
        Nothing could be fitted.
    """
    folder, choices = Path(folder), choices or Choices()
    protocol = read_run_protocol(folder)
    if protocol.protocol == "decay":
        return process_decay(folder, choices)
    rig, run = choices.bench(folder), read_run(folder)
    choices.check([frame for attempt in run.completed().values() for frame in attempt.frames])
    process = plugins.load(plugins.PROCESSING, protocol.protocol, str(folder))
    made = new_result(folder)
    with figure_style():
        found: StageResult = process(Stage(run, protocol, rig, choices, Known.of(rig), made))
        found = replace(
            found,
            sections=(*found.sections, *lamp_sections(run), *temperature_sections(run)),
            warnings=(*found.warnings, *temperature_warnings(run)),
        )
        write_stage_page(made / "report.html", _page(run, protocol, rig, found))
    write_provenance(made, _provenance(run, choices))
    changes = put_in_place(made)
    report = folder / "result" / "report.html"
    return Result(report, found.lines, found.warnings, changes)


def _page(run: RunRecord, protocol: ProtocolModel, rig: RigFile, found: StageResult) -> StagePage:
    attempts = list(run.completed().values())
    start = attempts[0].start if attempts else run.attempts[0].start
    identities = start.get("devices", {})
    return StagePage(
        title=protocol.sample.name,
        kind=protocol.protocol.replace("_", " ").capitalize(),
        run=run.folder.resolve().name,
        started=written_time(start["time"]),
        ended=written_time(run.last_time),
        rig=rig.name,
        simulated=rig.simulation is not None,
        labrig_version=version("labrig"),
        libraries=tuple(library_versions().items()),
        devices=tuple(
            DeviceLine(role, entry.address, identities.get(role, ""))
            for role, entry in rig.devices.items()
        ),
        guard=start.get("guard", ""),
        protocol_text=(run.folder / "protocol.yaml").read_text(encoding="utf-8"),
        rig_text=(run.folder / "rig.yaml").read_text(encoding="utf-8"),
        frames=tuple(frame for attempt in attempts for frame in attempt.frames),
        warnings=found.warnings,
        sections=(*found.sections, *_timing(attempts)),
        interruptions=interruptions(run),
        notes=read_notes(run.folder),
    )


def _timing(attempts: Sequence[Attempt]) -> Iterator[Section]:
    if said := moves_text([action for attempt in attempts for action in attempt.actions]):
        yield Section("Timing", (said,))


def _provenance(run: RunRecord, choices: Choices) -> StageProvenance:
    frames = [frame for attempt in run.completed().values() for frame in attempt.frames]
    return StageProvenance(
        labrig=version("labrig"),
        libraries=library_versions(),
        frames=dict(Counter(frame.purpose for frame in frames if not choices.excludes(frame))),
        excluded=tuple(frame.path.name for frame in frames if choices.excludes(frame)),
        optics=dict(choices.optics),
    )
