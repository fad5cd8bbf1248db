"""`labrig process`: from a recorded run to its result."""

import shlex
from dataclasses import replace
from functools import cache
from inspect import Parameter, Signature
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_origin

import typer
from typer.core import TyperCommand

from labrig.cli.completion import complete_run
from labrig.cli.screen import echo
from labrig.cli.wording import EDITED
from labrig.foundation.result_warning import warning_lines

if TYPE_CHECKING:
    from labrig.analyse import Overrides, ProcessOptions

#: Keys of the context's `meta`: given options of measurements, words of the line, options in help.
GIVEN, _WORDS, _SHOWN = "labrig.options", "labrig.words", "labrig.shown"


class ProcessCommand(TyperCommand):
    """Command that takes every measurement's options, and shows those of the run that is named."""

    helped_by = "labrig process RUN"

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the words of the line, which help needs to find the run."""
        ctx.meta[_WORDS] = tuple(args)
        return super().parse_args(ctx, args)

    def get_params(self, ctx: Any) -> list[Any]:
        """Return its own parameters and the options of measurements."""
        from labrig.foundation.plugins import measurements

        models = ctx.meta.get(_SHOWN)
        if models is None:
            loaded = (registered.load("options") for _, registered in measurements())
            models = [model for model in loaded if model is not None]
        return [*super().get_params(ctx), *_options(tuple(models))]

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Show its own options and, if a run is named, those of its measurements."""
        ctx.meta[_SHOWN] = _options_of_run(ctx.meta[_WORDS])
        super().format_options(ctx, formatter)


def _options_of_run(words: tuple[str, ...]) -> "list[type[ProcessOptions]]":
    """Return the options of the first run that is named; none where none is."""
    from labrig.acquire import read_run_protocol
    from labrig.analyse import options_of
    from labrig.catalogue import find_run
    from labrig.foundation.errors import LabrigError

    runs = Path("runs")
    for option, value in pairwise(words):
        if option == "--runs":
            runs = Path(value)
    for word in words:
        if word.startswith("-"):
            continue
        try:
            return options_of(read_run_protocol(find_run(Path(word), runs)))
        except LabrigError:
            continue
    return []


@cache
def _options(models: "tuple[type[ProcessOptions], ...]") -> tuple[Any, ...]:
    """Return one option for each field, by its name; fields of one name are one option."""
    from labrig.analyse import flag

    fields = {name: field for model in models for name, field in model.model_fields.items()}
    if not fields:
        return ()

    def take(**given: Any) -> None:
        """Take no options by itself: those of the signature below."""

    parameters = []
    for name, field in fields.items():
        kind: Any = str | None
        if get_origin(field.annotation) is tuple:
            kind = list[str] | None
        elif field.annotation is bool:
            kind = bool
        annotation = Annotated[kind, typer.Option(flag(name), help=field.description)]
        default = False if kind is bool else None
        parameters.append(
            Parameter(name, Parameter.KEYWORD_ONLY, default=default, annotation=annotation)
        )
    take.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
    take.__annotations__ = {each.name: each.annotation for each in parameters}
    app = typer.Typer(add_completion=False)
    app.command()(take)
    options = tuple(typer.main.get_command(app).params)
    for option in options:
        option.expose_value, option.callback = False, _keep
    return options


def _keep(context: Any, option: Any, value: Any) -> Any:
    """Keep a value that was given, for the measurement to which it belongs."""
    if value not in (None, False, ()) and value != []:
        context.meta.setdefault(GIVEN, {})[option.name] = value
    return value


def process(
    context: typer.Context,
    run: Annotated[
        Path,
        typer.Argument(
            help="A run folder, the beginning of its name, or 'last'.", autocompletion=complete_run
        ),
    ],
    roi: Annotated[
        list[str] | None,
        typer.Option("--roi", help="NAME=x,y,width,height (or x,y,…): another region. Repeatable."),
    ] = None,
    exclude: Annotated[
        list[str] | None,
        typer.Option("--exclude", help="Frame to leave out, by number or name. Repeatable."),
    ] = None,
    camera: Annotated[
        str | None,
        typer.Option("--camera", help="Camera curves to use instead, for the report's colours."),
    ] = None,
    optics: Annotated[
        list[str] | None,
        typer.Option(
            "--optics",
            help="KEY=PATH: another file or run for a key of the rig file's 'optics:', such as "
            "lvf=PATH. Repeatable.",
        ),
    ] = None,
    runs: Annotated[Path, typer.Option("--runs", help="Folder of the run folders.")] = Path("runs"),
    verify: Annotated[
        bool,
        typer.Option(
            "--verify",
            help="Read every frame, compare its checksum and reduce it anew, even if its file "
            "looks untouched.",
        ),
    ] = False,
    edited: Annotated[
        bool,
        typer.Option(
            EDITED,
            help="Take protocol.yaml and rig.yaml of the run folder as they were edited since, "
            "instead of what the journal has of them.",
        ),
    ] = False,
    json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> None:
    """Reduce, fit and report a run again, and say what changed.

    Each call starts from the settings of the run's protocol and rig: options of an earlier call are
    not kept unless they are given again, and the command says which. Measurements have options of
    their own: 'labrig process RUN --help' shows those of a run. An earlier result that differs is
    kept as result-1, result-2, … What was reduced from the frames before is used again, unless a
    region or a calibration that it depends on is another one.
    """
    from labrig.analyse import Overrides, verify_frames
    from labrig.catalogue import find_run, is_being_written
    from labrig.record import discard_cache, read_run

    options = context.meta.get(GIVEN, {})
    overrides = replace(
        Overrides.parse(roi or [], exclude or [], camera, optics or [], options), edited=edited
    )
    folder = find_run(run, runs)
    if is_being_written(folder):
        echo("note: this run is being recorded; so far only its complete units count", err=True)
    if verify:
        discard_cache(folder)
        echo(verify_frames(read_run(folder), overrides), err=True)
    process_and_print(folder, overrides, json=json)
    typer.echo(folder)


def print_edits(run: Path, *, is_taken: bool) -> None:
    """Print what was edited in a run's files since its journal has them, and what is used."""
    from labrig.record import edited_keys

    used = "the file's is used" if is_taken else f"the journal's is used; {EDITED} takes the file's"
    for line in edited_keys(run):
        echo(f"note: {line}; {used}", err=True)


def process_and_print(run: Path, overrides: "Overrides | None" = None, *, json: bool) -> None:
    """Process the run in the folder `run` and print its result."""
    from labrig.analyse import Overrides
    from labrig.foundation.activity import activity
    from labrig.process import process_and_report

    overrides = overrides or Overrides()
    print_edits(run, is_taken=overrides.edited)
    with activity(f"processing {run.name}"):
        processed = process_and_report(run, overrides)
    if processed.not_kept:
        again = " ".join(map(_quoted, (*processed.not_kept, *overrides.given())))
        echo(
            f"note: not kept from the result before: {', '.join(processed.not_kept)}; each "
            "processing starts from the protocol; to keep them: labrig process "
            f"{shlex.quote(str(run))} {again}",
            err=True,
        )
    if json:
        typer.echo(processed.result.to_json())
        return
    for line in warning_lines(processed.result.warnings, "warning: "):
        echo(line, err=True)
    for text in processed.lines:
        echo(text)
    for number, line in enumerate(processed.changes):
        echo(f"  {line}" if number else line)
    echo(f"report: {processed.report}")


def _quoted(option: str) -> str:
    """Return an option and its value as a shell takes them."""
    name, blank, value = option.partition(" ")
    return f"{name} {shlex.quote(value)}" if blank else name
