"""The command line, and its smallest commands; all import what they need when they are called."""

from functools import cache
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from labrig.cli import (
    design,
    fit,
    leds,
    material,
    page,
    process,
    protocol,
    queue,
    render,
    reproduce,
    rig,
    run,
    runs,
    verify,
)
from labrig.cli.completion import complete_run
from labrig.cli.process import ProcessCommand
from labrig.cli.screen import echo


class ByPurpose(TyperGroup):
    """Group of commands whose help lists them by what a person wants to do."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the commands, a section for each purpose in the order of registration."""
        members = [(name, self.commands[name]) for name in self.list_commands(ctx)]
        purposes = dict.fromkeys(getattr(member, "rich_help_panel", "") for _, member in members)
        for purpose in purposes:
            rows = [
                (name, member.get_short_help_str(formatter.width))
                for name, member in members
                if getattr(member, "rich_help_panel", "") == purpose and not member.hidden
            ]
            with formatter.section(purpose):
                formatter.write_dl(rows)


app = typer.Typer(
    cls=ByPurpose,
    help="From a lab bench to a measured phosphorescent or fluorescent material.",
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)

optics_app = typer.Typer(help="Curves of cameras, lamps and filters.", no_args_is_help=True)
sim_app = typer.Typer(help="Simulated devices for other programs.")


def frame(
    file: Annotated[Path, typer.Argument(help="A RAW file: Bayer, X-Trans, no colours.")],
    roi: Annotated[
        str | None,
        typer.Option("--roi", help="x,y,width,height in pixels of the visible frame."),
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Print as JSON.")] = False,
) -> None:
    """Mean, uncertainty, scatter, clipped and hot pixels per colour channel of a RAW file."""
    import json as json_format

    from labrig.foundation.region import parse_region
    from labrig.reduce import measure, read_raw

    region = None if roi is None else parse_region(roi)
    measured = measure(read_raw(file), region)
    if json:
        typer.echo(json_format.dumps(measured.to_json()))
    else:
        echo(str(measured))


def figures(
    run: Annotated[
        Path,
        typer.Argument(
            help="A run folder, the beginning of its name, or 'last'.", autocompletion=complete_run
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option("--out", help="PDF to write, instead of result/figures/figures.pdf of RUN."),
    ] = None,
    runs: Annotated[Path, typer.Option("--runs", help="Folder of the run folders.")] = Path("runs"),
) -> None:
    """Draw all figures of a run's report into one PDF, for print.

    They are drawn from result.json, so that nothing is measured or fitted again.
    """
    from labrig.catalogue import find_run
    from labrig.process import draw_figures

    path, n_pages = draw_figures(find_run(run, runs), out)
    echo(f"{path}: {n_pages} figures")


def schema(
    kind: Annotated[str, typer.Argument(help="protocol, rig, material, scene or design")],
) -> None:
    """Print the JSON Schema of a kind of file, for editors."""
    import json

    from labrig.schema import schema as schema_of

    typer.echo(json.dumps(schema_of(kind), indent=2))


def explain(
    name: Annotated[str, typer.Argument(help="A key of a file, the code of a warning, or a term.")],
) -> None:
    """Explain a key of a file, the code of a warning, or a term of the glossary."""
    from labrig.explain import explain as explain_name

    echo("\n\n".join(map(str, explain_name(name))))


@optics_app.command("show")
def show_curves(
    file: Annotated[str, typer.Argument(help="A file of curves, or a shipped camera.")],
    curve: Annotated[
        list[str] | None, typer.Option("--curve", help="Name of a curve; may be given again.")
    ] = None,
    picture: Annotated[
        Path | None, typer.Option("--picture", help="File for a figure (.png, .svg, .pdf).")
    ] = None,
) -> None:
    """Description and drawing of measured curves in a file."""
    from labrig.optics import read_checked_curves
    from labrig.report import describe_curves, draw_curves

    curves = read_checked_curves(file, curve)
    echo(describe_curves(curves))
    if picture is not None:
        draw_curves(curves, picture)
        echo(f"drawn into {picture}")


@optics_app.command("list")
def list_curves() -> None:
    """Cameras, colour filters and other curves that are shipped."""
    from labrig.report import describe_shipped_curves

    echo(describe_shipped_curves())


@sim_app.command("camera")
def serve_simulated_camera(
    port: Annotated[
        int,
        typer.Option("--port", min=0, max=65535, help="TCP port; 0 for any that is free."),
    ] = 15740,
    rig: Annotated[
        str, typer.Option("--rig", help="A shipped simulated rig, or a path to a YAML file.")
    ] = "sim",
) -> None:
    """Serve a simulated rig's camera as PTP/IP on this PC, until Ctrl-C."""
    from labrig.acquire import read_rig_file
    from labrig.bench import serve_camera
    from labrig.foundation import resources

    path = resources.find("config", "rig", rig)
    serve_camera(read_rig_file(path), str(path), port, typer.echo)


@sim_app.callback()
def simulations() -> None:
    """Simulated devices for other programs."""


MEASURE = "Measure"
app.command("plan", rich_help_panel=MEASURE)(run.plan)
app.command("run", rich_help_panel=MEASURE)(run.run)
app.command("resume", rich_help_panel=MEASURE)(run.resume)
app.command("watch", rich_help_panel=MEASURE)(page.watch)
app.add_typer(queue.app, name="queue", rich_help_panel=MEASURE)
app.add_typer(protocol.app, name="protocol", rich_help_panel=MEASURE)

EVALUATE = "Evaluate"
app.command("process", cls=ProcessCommand, rich_help_panel=EVALUATE)(process.process)
app.add_typer(fit.app, name="fit", rich_help_panel=EVALUATE)
app.add_typer(runs.app, name="runs", rich_help_panel=EVALUATE)
app.command("note", rich_help_panel=EVALUATE)(runs.note)
app.command("figures", rich_help_panel=EVALUATE)(figures)
app.add_typer(material.app, name="material", rich_help_panel=EVALUATE)

REPRODUCE = "Reproduce and design"
app.command("render", rich_help_panel=REPRODUCE)(render.render)
app.command("reproduce", rich_help_panel=REPRODUCE)(reproduce.reproduce)
app.command("design", rich_help_panel=REPRODUCE)(design.design)
app.add_typer(leds.app, name="leds", rich_help_panel=REPRODUCE)

KEEP = "Keep and prove"
app.command("verify", rich_help_panel=KEEP)(verify.verify)
app.command("seal", rich_help_panel=KEEP)(verify.seal)
app.add_typer(verify.key_app, name="key", rich_help_panel=KEEP)

BENCH = "Set up a bench"
app.add_typer(rig.app, name="rig", rich_help_panel=BENCH)
app.add_typer(optics_app, name="optics", rich_help_panel=BENCH)
app.command("frame", rich_help_panel=BENCH)(frame)
app.add_typer(sim_app, name="sim", rich_help_panel=BENCH)

HELP = "Look up and extend"
app.command("explain", rich_help_panel=HELP)(explain)
app.command("schema", rich_help_panel=HELP)(schema)
app.add_typer(protocol.driver_app, name="driver", rich_help_panel=HELP)


@app.callback(invoke_without_command=True)
def main(
    version: bool = typer.Option(False, "--version", help="Print the version and end."),
) -> None:
    """From a lab bench to a measured phosphorescent or fluorescent material."""
    if version:
        from importlib.metadata import version as installed

        echo(f"labrig {installed('labrig')}")
        raise typer.Exit


@cache
def command() -> TyperGroup:
    """Return the command line; its lists show each command's first sentence in full."""
    whole = typer.main.get_command(app)
    assert isinstance(whole, TyperGroup)
    _show_first_sentences(whole)
    return whole


def _show_first_sentences(group: TyperGroup) -> None:
    for member in group.commands.values():
        sentence, stop, _ = " ".join((member.help or "").split()).partition(". ")
        member.short_help = sentence + stop.strip()
        if isinstance(member, TyperGroup):
            _show_first_sentences(member)
