"""`labrig runs` and `labrig note`: recorded runs and notes on them."""

import itertools
import math
import sys
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from labrig.cli.completion import complete_protocol, complete_run
from labrig.cli.inline_picture import InlinePictures
from labrig.cli.runs_table import printable, progress_text, runs_csv, samples_table
from labrig.cli.screen import echo, echo_table, terminal_width
from labrig.cli.wording import counted, measurement
from labrig.foundation.errors import UsageError
from labrig.foundation.result_warning import warning_lines

if TYPE_CHECKING:
    from labrig.catalogue import Comparison, RunSummary


class _ListsByDefault(TyperGroup):
    """Group whose default command is `list`: `labrig runs --since 2026-11-20` needs no `list`."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        is_bare = not args or (args[0].startswith("-") and args[0] not in ctx.help_option_names)
        return super().parse_args(ctx, ["list", *args] if is_bare else args)


app = typer.Typer(
    help="The runs in a folder: list (the default, with its options), show one, compare two, "
    "depths of traps from several.",
    cls=_ListsByDefault,
)

Runs = Annotated[Path, typer.Option("--runs", help="Folder of the run folders.")]
Run = Annotated[
    Path,
    typer.Argument(
        help="A run folder, the beginning of its name, or 'last'.", autocompletion=complete_run
    ),
]
Sample = Annotated[str, typer.Option(help="Only samples of this name; * stands for anything.")]
Protocol = Annotated[
    str, typer.Option(help="Only runs of this protocol.", autocompletion=complete_protocol)
]
Since = Annotated[
    datetime | None,
    typer.Option(formats=["%Y-%m-%d"], help="Only runs of this day or later."),
]
Until = Annotated[
    datetime | None, typer.Option(formats=["%Y-%m-%d"], help="Only runs of this day or earlier.")
]
Status = Annotated[
    str | None,
    typer.Option(
        help="Only runs with this status: running, interrupted, failed, recorded, processed or "
        "damaged."
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print as JSON.")]


@app.command("list")
def list_them(
    runs: Runs = Path("runs"),
    sample: Sample = "*",
    protocol: Protocol = "*",
    since: Since = None,
    until: Until = None,
    status: Status = None,
    csv: Annotated[
        bool,
        typer.Option("--csv", help="Print a row a run, with all headline values and their σ."),
    ] = False,
    thumbnails: Annotated[
        bool,
        typer.Option(
            "--thumbnails/--no-thumbnails",
            help="Pictures of the samples, where the terminal says that it shows some (kitty, "
            "iTerm2).",
        ),
    ] = True,
    json: Json = False,
) -> None:
    """Samples with their runs: names for other commands, how far each run came, rates ± σ.

    The run that was made last is the last one; other commands also call it 'last'.
    """
    from datetime import date

    from labrig.catalogue import RunFilter, list_runs

    if csv and json:
        raise UsageError("expected --csv or --json, got both; give the one that you want to read")
    run_filter = RunFilter(
        sample,
        protocol,
        since.date() if since else date.min,
        until.date() if until else date.max,
        status,
    )
    summaries = list_runs(runs, run_filter)
    if json:
        _print_json([_summary_json(run) for run in summaries])
    elif csv:
        typer.echo(runs_csv(summaries), nl=False)
    elif summaries:
        _print_runs(summaries, thumbnails=thumbnails)
    else:
        echo(f"no such runs in {runs}")


@app.command("show")
def show(run: Run, runs: Runs = Path("runs"), json: Json = False) -> None:
    """All there is to know of one run, its notes and earlier results included."""
    from labrig.catalogue import find_run, indexed_summary, unfinished
    from labrig.record import edited_keys, read_notes

    folder = find_run(run, runs)
    summary, notes, edits = indexed_summary(folder), read_notes(folder), edited_keys(folder)
    if json:
        about = {"notes": notes, "unfinished": unfinished(summary), "edited": edits}
        _print_json({**_summary_json(summary), **about})
        return
    echo(f"{folder}")
    measured = measurement(summary.protocol, summary.sample)
    echo(f"  {measured}, {_when(summary)}, {summary.status}")
    units = "unit" if summary.units == 1 else "units"
    echo(f"  {progress_text(summary)} {units}, {counted(summary.frames, 'frame')}")
    for line in unfinished(summary):
        echo(f"  {printable(line)}")
    for line in edits:
        echo(f"  {printable(line)}; the journal's counts")
    _print_results(folder)
    report = folder / "result" / "report.html"
    if report.is_file():
        echo(f"  report: {report}")
    if notes:
        echo("\n" + notes.rstrip())


@app.command("restore")
def restore(
    run: Run,
    result: Annotated[str, typer.Argument(help="The earlier result, such as 'result-2'.")],
    runs: Runs = Path("runs"),
) -> None:
    """Make an earlier result of a run its result again, as before a 'labrig process'."""
    from labrig.catalogue import find_run
    from labrig.process import restore_result

    folder = find_run(run, runs)
    lines = restore_result(folder, result)
    echo(f"{folder}: {result} is its result again")
    for line in lines:
        echo(f"  {line}")


@app.command("stack")
def stack(
    run: Run,
    runs: Runs = Path("runs"),
    out: Annotated[
        Path | None, typer.Option("--out", help="TIFF to write, instead of RUN/result/decay.tif.")
    ] = None,
    width: Annotated[
        int | None,
        typer.Option("--width", min=1, help="Width to which pictures are averaged, in pixels."),
    ] = None,
) -> None:
    """The frames of a decay as one TIFF of linear values, for ImageJ or napari; times in a CSV."""
    from labrig.analyse import Overrides, intact_frames
    from labrig.catalogue import find_run, indexed_summary
    from labrig.export import write_image_stack
    from labrig.foundation.output_file import write_text
    from labrig.record import FrameRole, read_run

    folder = find_run(run, runs)
    record, summary = read_run(folder), indexed_summary(folder)
    if not record.frames(FrameRole.DECAY) and summary.done == summary.units:
        raise UsageError(
            f"{folder}: expected a run with frames of a decay, got one of {summary.protocol}, "
            "which takes none"
        )
    frames = intact_frames(record, Overrides())
    path = out or folder / "result" / "decay.tif"
    ordered = sorted(frames.decay, key=lambda frame: frame.t_s)
    times, channels, rows, columns = write_image_stack(path, ordered, frames.dark, width)
    table = path.with_suffix(".csv")
    lines = [f"{each.path.name},{each.t_s:.6f},{each.exposure_s:.9g}" for each in ordered]
    write_text(table, "\n".join(["frame,t_s,exposure_s", *lines]) + "\n")
    echo(f"{path}: {times} times, {channels} channels, {columns} × {rows} pixels, in DN/s")
    echo(f"{table}: begin after lamp off and exposure time of each")


@app.command("compare")
def compare(
    run: Run,
    other: Run,
    runs: Runs = Path("runs"),
    reference: Annotated[
        str | None,
        typer.Option(help="A patch with the same source on both days; ties their amplitudes."),
    ] = None,
    json: Json = False,
) -> None:
    """Two runs of a sample: rates with σ, and whether they differ."""
    from dataclasses import asdict

    from labrig.catalogue import compare_runs, find_run

    first, second = find_run(run, runs), find_run(other, runs)
    comparison = compare_runs(first, second, reference)
    if first.resolve() == second.resolve():
        raise UsageError(f"expected two runs, got {first} twice; name another one (labrig runs)")
    if json:
        patches = [
            {**asdict(patch), "assessment": patch.assessment} for patch in comparison.patches
        ]
        _print_json({**asdict(comparison), "patches": patches})
    else:
        _print_comparison(comparison)


@app.command("trap-depth")
def trap_depth(
    run: Annotated[
        list[str],
        typer.Argument(help="Runs of one sample at two temperatures or more."),
    ],
    runs: Runs = Path("runs"),
    temperatures: Annotated[
        str | None,
        typer.Option(
            help="Temperature of each run in °C, '15, 21, 30'; without it that of the thermometer."
        ),
    ] = None,
    temperature_sigma: Annotated[
        str, typer.Option(help="σ of each temperature, such as '0.1 K'.")
    ] = "0.3 K",
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder for trap_depth.json, the page, its figure.")
    ] = None,
    json: Json = False,
) -> None:
    """Depths of traps from decays at several temperatures, by Arrhenius' law."""
    from labrig.catalogue import find_run, trap_depths
    from labrig.process import report_trap_depths
    from labrig.results import trap_depths_json

    folders = [find_run(Path(each), runs) for each in run]
    depths = trap_depths(
        folders, _temperatures_c(temperatures), _temperature_sigma_k(temperature_sigma)
    )
    names = tuple(folder.name for folder in folders)
    if json:
        typer.echo(trap_depths_json(depths, names))
    else:
        for each in depths:
            echo(f"{each.name}\n{each.depth}\n")
    if out is not None:
        typer.echo(f"report: {report_trap_depths(depths, names, out)}", err=json)


def _temperatures_c(text: str | None) -> list[float] | None:
    if text is None:
        return None
    try:
        return [float(part.strip().removesuffix("C").rstrip(" °")) for part in text.split(",")]
    except ValueError:
        raise UsageError(
            f"--temperatures: expected numbers in °C such as '15, 21, 30', got '{text}'"
        ) from None


def _temperature_sigma_k(text: str) -> float:
    from labrig.foundation.quantity import TEMPERATURE_STEP_K, parse

    try:
        return parse(text, TEMPERATURE_STEP_K)
    except ValueError as error:
        raise UsageError(f"--temperature-sigma: {error}") from None


def note(
    run: Run,
    text: Annotated[str, typer.Argument(help="What there is to say; Markdown if you like.")],
    runs: Runs = Path("runs"),
) -> None:
    """Add a note to a run, such as an observation; it is kept in notes.md in its folder."""
    from labrig.catalogue import find_run
    from labrig.foundation.clock import SystemClock
    from labrig.record import add_note

    echo(add_note(find_run(run, runs), text, SystemClock().wall()))


def _print_runs(summaries: Sequence["RunSummary"], *, thumbnails: bool) -> None:
    """Print the table of samples; whatever its width, every name can be copied."""
    columns = terminal_width(sys.stdout)
    pictures = InlinePictures.of_terminal() if thumbnails else None
    typer.echo(samples_table(summaries, columns, pictures))


def _print_comparison(comparison: "Comparison") -> None:
    from labrig.foundation.number_format import plus_minus

    for key, value_a, value_b in comparison.protocol_differences:
        echo(f"asked differently: {key}: {value_a} | {value_b}")
    for line in warning_lines(comparison.warnings, "warning: "):
        echo(line)
    if comparison.missing:
        echo(f"fitted in only one of them: {', '.join(comparison.missing)}")
    if not comparison.patches:
        echo("no patch is fitted in both")
    for patch in comparison.patches:
        echo(f"{patch.patch}: {patch.assessment}")
        rows = [
            (
                " in ".join(filter(None, (difference.quantity, difference.unit))),
                plus_minus(difference.a.value, difference.a.sigma),
                plus_minus(difference.b.value, difference.b.sigma),
                "–" if math.isnan(difference.pull) else f"{difference.pull:+.1f}".replace("-", "−"),
            )
            for difference in patch.differences
        ]
        if rows:
            echo_table(("", "run A", "run B", "B − A in σ"), rows)
        if patch.gain.sigma:
            gain = plus_minus(patch.gain.value, patch.gain.sigma)
            echo(f"a of run B is multiplied by {gain}, by the reference")
    if not any(patch.gain.sigma for patch in comparison.patches):
        echo("a is in each day's own DN/s; a source that stays, as --reference, ties them")


def _print_results(folder: Path) -> None:
    """Print each result and the settings in which it differs from the one before it."""
    from labrig.process import other_settings
    from labrig.results import read_summary

    results = _result_folders(folder)
    for result, before in itertools.zip_longest(results, results[1:]):
        if lines := read_summary(folder / result):
            echo(f"  {result}:")
            for line in lines:
                echo(f"    {printable(line)}")
        if before is not None:
            for line in other_settings(folder / before, folder / result):
                echo(f"    {line}")


def _result_folders(folder: Path) -> list[str]:
    """Return the names of the result folders from new to old, the latest first."""
    earlier = sorted(
        (path.name for path in folder.glob("result-*") if path.name[7:].isdecimal()),
        key=lambda name: -int(name[7:]),
    )
    return ["result", *earlier]


def _when(run: "RunSummary") -> str:
    return "not begun" if run.began is None else f"{run.began:%Y-%m-%d %H:%M} UTC"


def _summary_json(run: "RunSummary") -> dict[str, object]:
    from dataclasses import asdict

    began = None if run.began is None else run.began.isoformat()
    return {
        **asdict(run),
        "folder": str(run.folder),
        "made": run.made.isoformat(),
        "began": began,
    }


def _print_json(content: object) -> None:
    import json

    typer.echo(json.dumps(content, default=str))
