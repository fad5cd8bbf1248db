"""A run of any protocol, from its folder to its result, report and exports."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

from labrig import plugins
from labrig.acquire import ProtocolModel, RigFile
from labrig.analyse import Choices, Inputs, Part
from labrig.analyse.choices import read_run_protocol
from labrig.analyse.history import interruptions, lamp_sections, written_time
from labrig.analyse.part import StageResult
from labrig.analyse.temperature import temperature_sections, temperature_warnings
from labrig.process.decay import process_decay
from labrig.process.page import camera_response
from labrig.process.provenance import StageProvenance, library_versions
from labrig.process.result import Result
from labrig.process.result_folder import new_result, put_in_place, write_provenance
from labrig.record import Attempt, RunRecord, read_notes, read_run
from labrig.report import DeviceLine, StagePage, figure_style, write_stage_page
from labrig.report.render import render
from labrig.report.rendering import Rendered, Source
from labrig.report.sections import Section
from labrig.report.timing import moves_text
from labrig.results import write_result


@dataclass(frozen=True)
class Processed:
    """What came out of a run, and what a person is told of it.

    Attributes
    ----------
    result
        Of the type that belongs to the protocol.
    report
        The page.
    lines
        The numbers that matter, for the terminal.
    changes
        What is other than in the result before, if there was one.
    """

    result: Any
    report: Path
    lines: tuple[str, ...]
    changes: tuple[str, ...]


def process_run(folder: Path | str, choices: Choices | None = None) -> Any:
    """Reduce and fit the run in `folder`, write `result/` and the report in it.

    A `result` that comes out any different from the one before takes its place; that one is kept
    as `result-1`, `result-2`, …

    Parameters
    ----------
    folder
        A run folder.
    choices
        What is wanted otherwise than the protocol says.

    Returns
    -------
    RunResult
        Of the type that belongs to the run's protocol.

    Raises
    ------
    UsageError
        Not a run folder, or a choice that does not fit it.
    DataError
        What there is does not suffice, or a frame is missing or was changed after the run.
    FitError
        Nothing could be fitted.
    """
    return process_and_report(folder, choices).result


def process_and_report(folder: Path | str, choices: Choices | None = None) -> Processed:
    """As `process_run`; with where the report is, and what a person is told."""
    folder, choices = Path(folder), choices or Choices()
    protocol = read_run_protocol(folder)
    if protocol.protocol == "decay":
        old = process_decay(folder, choices)
        return Processed(old, old.report, old.lines, old.changes)
    rig, run = choices.bench(folder), read_run(folder)
    choices.check([frame for attempt in run.completed().values() for frame in attempt.frames])
    analyse = plugins.load(plugins.ANALYSES, protocol.protocol, str(folder))
    made = new_result(folder)
    with figure_style():
        result: Any = analyse(Part(run, protocol, rig, choices, Inputs.of(rig), made))
        camera, unknown_camera = camera_response(rig, choices.camera)
        warnings = (*result.warnings, *unknown_camera, *temperature_warnings(run))
        result = replace(result, warnings=warnings)
        if isinstance(result, StageResult):
            rendered = Rendered(result.sections, result.lines)
        else:
            write_result(made, result)
            rendered = render(result, Source(run, protocol, rig, camera))
        sections = (*rendered.sections, *lamp_sections(run), *temperature_sections(run))
        write_stage_page(made / "report.html", _page(run, protocol, rig, sections, result.warnings))
    write_provenance(made, _provenance(run, choices))
    changes = put_in_place(made)
    report = folder / "result" / "report.html"
    if isinstance(result, StageResult):
        result = Result(report, result.lines, result.warnings, changes)
    return Processed(result, report, rendered.lines, changes)


def _page(
    run: RunRecord,
    protocol: ProtocolModel,
    rig: RigFile,
    sections: Sequence[Section],
    warnings: tuple[str, ...],
) -> StagePage:
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
        warnings=warnings,
        sections=(*sections, *_timing(attempts)),
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
