"""Processing of a run of any protocol, from its folder to result, report and exports."""

import shutil
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from labrig.acquire import (
    EDITED,
    ProtocolModel,
    RigFile,
    read_run_protocol,
    result_takes_edits,
)
from labrig.analyse import (
    AnalysisContext,
    Inputs,
    Overrides,
    analyse_part,
    check_options,
    clock_warnings,
    reference_of,
    require_recorded_settings,
    temperature_warnings,
)
from labrig.bench_optics import camera_curves, with_shipped_camera
from labrig.calibration import LVF_KIND, LvfFile, keep_calibration, kept_calibrations
from labrig.export import write_nexus
from labrig.foundation.errors import DiskError, FitError, UsageError
from labrig.foundation.output_file import make_folder_in, write_durably
from labrig.foundation.plugins import measurement
from labrig.foundation.processors import one_linear_algebra_thread
from labrig.foundation.result_warning import (
    Contradiction,
    ResultWarning,
    Unmeasured,
    warning_lines,
)
from labrig.foundation.yaml_file import read_model, write_yaml
from labrig.optics import CameraResponse
from labrig.process.comparison import LOCK, include_comparison
from labrig.process.provenance import (
    PROVENANCE,
    Provenance,
    describe_run,
    given_before,
    provenance,
)
from labrig.process.result_changes import changes
from labrig.process.verification import require_as_sealed
from labrig.record import (
    PC_CLOCK,
    FrameRecord,
    RunLock,
    RunRecord,
    clock_stepped,
    edited_keys,
    read_run,
    require_plain_folder,
)
from labrig.report import (
    Rendered,
    Report,
    Source,
    calibration_sections,
    lamp_sections,
    render,
    sample_picture,
    temperature_sections,
    write_figures_pdf,
    write_report,
)
from labrig.results import (
    SAMPLE_PICTURE,
    ChainResult,
    RunResult,
    read_result,
    write_result,
    write_summary,
)

_EARLIER = "result-"
#: Exposure time in seconds below which a frame of a glow is mostly noise; for display only.
BRIEF_S = 1 / 30


def new_result(run: Path) -> Path:
    """Create an empty folder in `run` for `put_in_place`.

    Raises
    ------
    DataError
        Something in the result before is neither a file nor a folder.
    DiskError
        The folder cannot be made.
    """
    require_plain_folder(run / "result")
    folder = make_folder_in(run, "result.part")
    try:
        shutil.rmtree(folder)
        folder.mkdir()
    except OSError as error:
        raise DiskError(f"{folder}: cannot be made ({error.strerror})") from None
    return folder


def put_in_place(folder: Path) -> tuple[str, ...]:
    """Make `folder` the run's `result` and return the changes, in lines for people.

    An earlier result that differs is kept as `result-1`, `result-2`, …, from old to new. If all
    bytes are equal, the earlier result stays and `folder` is deleted.
    """
    final = folder.with_name("result")
    if not final.exists():
        folder.rename(final)
        return ()
    lines = changes(final, folder)
    if not lines:
        shutil.rmtree(folder)
        return ("the same result as before",)
    numbers = [int(path.name[len(_EARLIER) :]) for path in _earlier_results(folder.parent)]
    earlier = folder.with_name(f"{_EARLIER}{max(numbers, default=0) + 1}")
    final.rename(earlier)
    folder.rename(final)
    return (f"changed since the result before, which is kept as {earlier.name}:", *lines)


def restore_result(run: Path, name: str) -> tuple[str, ...]:
    """Make an earlier result of a run its result again; the present one is kept as the newest.

    The calibrations that are kept beside a run of a calibration are those of its result again.

    Parameters
    ----------
    run
        Run folder.
    name
        Name of the earlier result, such as `result-2`.

    Returns
    -------
    tuple of str
        What that changed, in lines for people.

    Raises
    ------
    UsageError
        The run has no such earlier result, or another process works on it.
    DataError
        The run is sealed and was changed since.

    Examples
    --------
    >>> from labrig.process import restore_result
    >>> restore_result("runs/decay", "result-99")
    Traceback (most recent call last):
    labrig.foundation.errors.UsageError: runs/decay: expected the name of an earlier result, got
    'result-99'; ...
    """
    run = Path(run)
    names = sorted((path.name for path in _earlier_results(run)), key=lambda each: int(each[7:]))
    if name not in names:
        present = f"it has {', '.join(names)}" if names else "the run has none"
        raise UsageError(f"{run}: expected the name of an earlier result, got '{name}'; {present}")
    kept = {each.folder.name: each for each in kept_calibrations(run.resolve().parent)}
    with RunLock(run / LOCK, "restoring a result of this run"):
        require_as_sealed(run)
        lines = put_in_place(run / name)
        if (of_run := kept.get(run.resolve().name)) is not None:
            keep_calibration(run, of_run.reference)
    return lines


def _earlier_results(run: Path) -> list[Path]:
    return [path for path in run.glob(f"{_EARLIER}*") if path.name[len(_EARLIER) :].isdecimal()]


def write_provenance(folder: Path, provenance: Provenance) -> None:
    """Write `provenance.yaml` into `folder`."""
    write_yaml(folder / PROVENANCE, provenance)


@dataclass(frozen=True)
class Processed:
    """Outcome of the processing of a run.

    Attributes
    ----------
    result
        Result of the type that belongs to the protocol.
    report
        Path of the HTML report.
    lines
        Most important numbers, in lines for the terminal.
    changes
        Differences from the result before; empty if there was none.
    not_kept
        Options that were given for the result before, and are not for this one, such as
        `--states 2`: each processing starts from the protocol and the rig file.
    """

    result: RunResult
    report: Path
    lines: tuple[str, ...]
    changes: tuple[str, ...]
    not_kept: tuple[str, ...] = ()


def process_run(folder: Path | str, overrides: Overrides | None = None) -> RunResult:
    """Reduce and fit a run and write its results and its report.

    The files are written to the folder `result` of the run. A `result` that differs from the one
    before replaces it; the earlier one is kept as `result-1`, `result-2`, …

    Parameters
    ----------
    folder
        Run folder.
    overrides
        Settings that replace those of the protocol and of the rig file.

    Returns
    -------
    RunResult
        Result of the type that belongs to the run's protocol.

    Raises
    ------
    UsageError
        If this is not a run folder, another labrig is processing it, or an override does not fit
        the run.
    DataError
        If frames are too few, missing, or were changed after the run.
    FitError
        If nothing could be fitted.

    Examples
    --------
    >>> import labrig
    >>> result = labrig.process_run("runs/decay")
    >>> [f"{rate.value:.4f}" for rate in result.patches["sample"].fit.rates]
    ['0.2048', '0.0101']
    """
    return process_and_report(folder, overrides).result


def process_and_report(folder: Path | str, overrides: Overrides | None = None) -> Processed:
    """Reduce and fit a run and return its result with a summary for people.

    Parameters
    ----------
    folder
        Run folder.
    overrides
        Settings that replace those of the protocol and of the rig file.

    Returns
    -------
    Processed
        Result, path of the report, summary, and changes since the result before.

    Raises
    ------
    UsageError
        If this is not a run folder, another labrig is processing it, or an override does not fit
        the run.
    DataError
        If frames are too few, missing, or were changed after the run.
    FitError
        If nothing could be fitted; the report is written nevertheless.

    Examples
    --------
    >>> from labrig.process import process_and_report
    >>> processed = process_and_report("runs/decay")
    >>> processed.report.as_posix()
    'runs/decay/result/report.html'
    >>> print(processed.lines[0].splitlines()[1])
    state  k / s⁻¹      1/k / s    amplitude / (DN/s)
    """
    folder, overrides = Path(folder), overrides or Overrides()
    protocol = overrides.protocol(folder)
    with RunLock(folder / LOCK, "processing this run"):
        return _process(folder, overrides, protocol)


def _process(folder: Path, overrides: Overrides, protocol: ProtocolModel) -> Processed:
    """Process a run that no other process processes meanwhile."""
    check_options(overrides.options, protocol)
    require_as_sealed(folder)
    analysed = _analysed_frames(read_run(folder), protocol, overrides)
    part, result, _ = analysed
    result_folder = new_result(folder)
    rendered = _write(result_folder, *analysed)
    include_comparison(folder, result_folder)
    not_kept = tuple(overrides.not_kept(given_before(folder)))
    changes = put_in_place(result_folder)
    keep_calibration(folder, None if result.failures() else reference_of(part, result))

    page = folder / "result" / "report.html"
    if failures := result.failures():
        raise FitError(f"{'; '.join(failures)}; the run is kept, see {page}")
    return Processed(result.of_run(folder), page, rendered.lines, changes, not_kept)


def process_so_far(folder: Path) -> None:
    """Process a run that is being recorded, for what is kept of its frames; write no result.

    Parameters
    ----------
    folder
        Run folder.

    Raises
    ------
    LabrigError
        There is too little yet for a result; all frames reduced before that are kept.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.process.run import process_so_far
    >>> process_so_far(Path("runs/decay"))
    """
    overrides = Overrides()
    analysed = _analysed_frames(read_run(folder).so_far(), overrides.protocol(folder), overrides)
    with TemporaryDirectory(prefix="labrig-") as discarded:
        _write(Path(discarded), *analysed)


def _analysed_frames(
    run: RunRecord, protocol: ProtocolModel, overrides: Overrides
) -> tuple[AnalysisContext, RunResult, CameraResponse | None]:
    """Analyse a run whose frames have the settings that its journal says."""
    bench = overrides.bench(run.folder)
    overrides.check([file for attempt in run.completed().values() for file in attempt.files])
    require_recorded_settings(run, bench, overrides)
    rig = with_shipped_camera(bench, run.camera_identity)
    return _analysed(run, protocol, rig, overrides)


def _write(
    folder: Path, part: AnalysisContext, result: RunResult, camera: CameraResponse | None
) -> Rendered:
    """Write result, exports and report of a run into a folder, and return what was rendered."""
    run, protocol, rig, overrides = part.run, part.protocol, part.rig, part.overrides
    about = describe_run(run, protocol, rig, edited=overrides.edited)
    write_provenance(folder, provenance(run, protocol, overrides, camera.name if camera else None))
    write_result(folder, result)
    write_nexus(folder / "run.nxs", run, about, result)
    shown = [sorted(run.frames(role), key=_dimness) for role in protocol.picture_frames]
    if (picture := sample_picture([*chain.from_iterable(shown)], camera)) is not None:
        write_durably(folder / SAMPLE_PICTURE, picture)
    rendered = _render(result, Source(run, protocol, rig, about, camera))
    warning_texts = warning_lines(result.warnings, "warning: ")
    write_summary(folder, [*rendered.lines, *warning_texts])
    frames = [frame for attempt in run.completed().values() for frame in attempt.frames]
    report = Report(about, result.warnings, rendered.sections, rendered.methods, frames, camera)
    write_report(folder / "report.html", report)
    return rendered


def _dimness(frame: FrameRecord) -> tuple[bool, float]:
    """Return a rank: metered frames are the shorter, the brighter it is; brief ones are noisy."""
    return frame.exposure_s < BRIEF_S, frame.exposure_s * frame.iso


def _analysed(
    run: RunRecord, protocol: ProtocolModel, rig: RigFile, overrides: Overrides
) -> tuple[AnalysisContext, RunResult, CameraResponse | None]:
    """Return what was analysed, the result with all its warnings, and the camera's curves."""
    analyse = measurement(protocol.protocol, str(run.folder)).load("analysis")
    inputs = Inputs.of(rig)
    part = AnalysisContext(run, protocol, rig, overrides, inputs)
    with one_linear_algebra_thread():
        result: RunResult = analyse(part)
    lvf = inputs.updated_by(result)[LVF_KIND]
    camera, unknown_camera = _camera_response(rig, overrides.camera, lvf)
    warnings = (
        *result.warnings,
        *clock_warnings(run),
        *unknown_camera,
        *temperature_warnings(run, protocol.rate_frames),
        *_clock_step_warnings(run),
        *_unfinished_warnings(run, protocol),
        *_edited_warnings(run.folder, overrides),
    )
    return part, replace(result, warnings=warnings), camera


def refit(result: RunResult, options: Mapping[str, Any]) -> RunResult:
    """Return the result of a run with other options of its measurement, and write nothing.

    Parameters
    ----------
    result
        Result by `read_result` or `process_run`, or that of a part of a chain.
    options
        The measurement's own options by name, such as `states` of a decay.

    Returns
    -------
    RunResult
        Result of the same frames, regions and calibrations.

    Raises
    ------
    UsageError
        The result belongs to no run folder, the measurement has no such option, or another labrig
        is processing the run.
    FitError
        Nothing can be fitted.

    Examples
    --------
    >>> import labrig
    >>> from labrig.process import refit
    >>> one = refit(labrig.read_result("runs/decay"), {"states": 1})
    >>> [f"{rate.value:.4f}" for rate in one.patches["sample"].fit.rates]
    ['0.0183']
    """
    folder = _folder_of(result)
    made = read_model(folder / "result" / PROVENANCE, Provenance)
    is_edited = EDITED in made.given
    protocol = read_run_protocol(folder, edited=is_edited)
    regions = made.regions if hasattr(protocol, "patches") else {}
    overrides = Overrides(
        regions, frozenset(made.excluded), None, made.optics, options, edited=is_edited
    )
    check_options(options, protocol)
    with RunLock(folder / LOCK, "processing this run"):
        run = read_run(folder)
        rig = with_shipped_camera(overrides.bench(folder), run.camera_identity)
        if not result.run_part:
            return _analysed(run, protocol, rig, overrides)[1].of_run(folder)
        whole = read_result(folder)
        assert isinstance(whole, ChainResult), "only a chain has parts"
        chain = AnalysisContext(run, protocol, rig, overrides, Inputs.of(rig))
        refitted = analyse_part(chain, result.run_part, whole.parts)
    return refitted.of_run(folder, result.run_part)


def _folder_of(result: RunResult) -> Path:
    if result.run_folder is None:
        raise UsageError(
            f"expected the result of a run, got one of '{result.kind}' that belongs to no run "
            "folder; read it with labrig.read_result"
        )
    return result.run_folder


def rendered_result(result: RunResult) -> Rendered:
    """Return the sections of a run's report, made of its result.

    Parameters
    ----------
    result
        Result by `read_result` or `process_run`, or that of a part of a chain.

    Returns
    -------
    Rendered
        Sections as in the report, whose figures are not yet drawn.

    Raises
    ------
    UsageError
        The result belongs to no run folder.
    DataError
        The run's folder was changed.

    Examples
    --------
    >>> import labrig
    >>> from labrig.process import rendered_result
    >>> sections = rendered_result(labrig.read_result("runs/decay")).sections
    >>> [section.title for section in sections][:2]
    ['Results', 'Sample']
    """
    source = _source_of(result)
    if not result.run_part:
        return _render(result, source)
    chain: Any = source.protocol
    link = next(link for link in chain.chain() if link.name == result.run_part)
    return render(result, replace(source, run=source.run.part(link.name), protocol=link.protocol))


def _source_of(result: RunResult) -> Source:
    """Return what the report of a result needs of its run."""
    folder = _folder_of(result)
    overrides = Overrides(edited=result_takes_edits(folder))
    run, protocol = read_run(folder), overrides.protocol(folder)
    rig = with_shipped_camera(overrides.bench(folder), run.camera_identity)
    camera, _ = _camera_response(rig, None, Inputs.of(rig).updated_by(result)[LVF_KIND])
    about = describe_run(run, protocol, rig, edited=overrides.edited)
    return Source(run, protocol, rig, about, camera)


def draw_figures(folder: Path | str, path: Path | None = None) -> tuple[Path, int]:
    """Draw all figures of a run's report into one PDF, from the result of its latest analysis.

    Parameters
    ----------
    folder
        Run folder.
    path
        Path of the PDF; None for `result/figures/figures.pdf` in the run folder.

    Returns
    -------
    path : Path
        Path of the PDF.
    n_pages : int
        Number of figures, one a page.

    Raises
    ------
    UsageError
        If this is not a run folder, or there is no result, or there are no figures.
    DataError
        If the result was changed, or another version of labrig wrote it.
    DiskError
        If the PDF cannot be written.

    Examples
    --------
    >>> from labrig.process import draw_figures
    >>> path, n_pages = draw_figures("runs/decay")
    >>> path.as_posix(), n_pages
    ('runs/decay/result/figures/figures.pdf', 8)
    """
    folder = Path(folder)
    result = read_result(folder)
    source = _source_of(result)
    path = path or folder / "result" / "figures" / "figures.pdf"
    title = f"{source.protocol.sample.name}, {source.run.name}"
    n_pages = write_figures_pdf(path, title, _render(result, source).sections)
    if not n_pages:
        raise UsageError(f"{folder}: expected a report with figures, it has none")
    return path, n_pages


def _render(result: RunResult, source: Source) -> Rendered:
    """Render a result, followed by the sections that do not depend on the protocol."""
    rendered = render(result, source)
    # After the parts of a chain, what is about all of them.
    part = "the_run" if any(section.part for section in rendered.sections) else ""
    rate_frames = source.protocol.rate_frames
    about_run = (
        *calibration_sections(source.run),
        *lamp_sections(source.run),
        *temperature_sections(source.run, rate_frames),
    )
    more = tuple(replace(section, part=part) for section in about_run)
    return replace(rendered, sections=(*rendered.sections, *more))


def _unfinished_warnings(run: RunRecord, protocol: ProtocolModel) -> tuple[ResultWarning, ...]:
    """Return a warning of the units that an unfinished run lacks."""
    units, completed = [unit.name for unit in protocol.units()], run.completed()
    if not (missing := [name for name in units if name not in completed]):
        return ()
    return (
        Unmeasured(
            "run-unfinished",
            "the run is not finished: {missing} of {units} units are missing, from {first} on; go "
            "on with: labrig resume {run}",
            missing=len(missing),
            units=len(units),
            first=missing[0],
            run=run.name,
        ),
    )


def _edited_warnings(folder: Path, overrides: Overrides) -> tuple[ResultWarning, ...]:
    """Return a warning of edits of the run's files that were taken instead of its journal."""
    if not overrides.edited or not (edits := edited_keys(folder)):
        return ()
    return (
        Contradiction(
            "run-edited",
            "processed by files that were edited since the run was recorded: {edits}",
            edits="; ".join(edits),
        ),
    )


def _clock_step_warnings(run: RunRecord) -> tuple[ResultWarning, ...]:
    """Return a warning of each step of the PC's clock during the completed units of a run."""
    return tuple(
        clock_stepped(f"{action.action} in {attempt.unit}")
        for attempt in run.completed().values()
        for action in attempt.actions
        if action.device == PC_CLOCK
    )


def _camera_response(
    rig: RigFile, replacement: str | None, lvf: LvfFile | None
) -> tuple[CameraResponse | None, tuple[ResultWarning, ...]]:
    """Return the curves that colour the report's pictures, or a warning if they are missing."""
    try:
        camera = camera_curves(rig, replacement, lvf)
    except UsageError as error:
        if replacement is not None:
            raise
        is_named = rig.optics.camera is not None
        own = Unmeasured(
            "camera-curves-missing",
            "colours in the report are the camera's own: {reason}",
            reason=str(error),
        )
        return None, (own,) if is_named else ()
    if camera.has_ratios:
        return camera, ()
    return camera, (
        Unmeasured(
            "camera-curves-scaled",
            "the curves of {camera} have every channel scaled to 1: colours, and all that "
            "compares channels, are off; name curves with the channels' ratios under 'optics:'",
            camera=camera.name,
        ),
    )
