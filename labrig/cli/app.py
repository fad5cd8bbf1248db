"""The command line; commands import what they need when they are called."""

from functools import cache

import typer
from typer.core import TyperGroup

from labrig.cli import (
    compare,
    design,
    driver,
    figures,
    fit,
    frame,
    key,
    leds,
    material,
    optics,
    process,
    protocol,
    queue,
    render,
    rig,
    run,
    runs,
    schema,
    sim,
    verify,
    watch,
)
from labrig.cli.process_command import ProcessCommand

app = typer.Typer(
    help="From a lab bench to a measured phosphorescent or fluorescent material.",
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command("run")(run.run)
app.command("plan")(run.plan)
app.command("resume")(run.resume)
app.command("process", cls=ProcessCommand)(process.process)
app.command("figures")(figures.figures)
app.command("frame")(frame.frame)
app.command("compare")(compare.compare)
app.command("render")(render.render)
app.command("note")(runs.note)
app.command("design")(design.design)
app.command("verify")(verify.verify)
app.command("seal")(verify.seal)
app.command("watch")(watch.watch)
app.command("schema")(schema.schema)
app.add_typer(driver.app, name="driver")
app.add_typer(fit.app, name="fit")
app.add_typer(key.app, name="key")
app.add_typer(leds.app, name="leds")
app.add_typer(material.app, name="material")
app.add_typer(optics.app, name="optics")
app.add_typer(protocol.app, name="protocol")
app.add_typer(queue.app, name="queue")
app.add_typer(rig.app, name="rig")
app.add_typer(runs.app, name="runs")
app.add_typer(sim.app, name="sim")


@app.callback(invoke_without_command=True)
def main(
    version: bool = typer.Option(False, "--version", help="Print the version and end."),
) -> None:
    """From a lab bench to a measured phosphorescent or fluorescent material."""
    if version:
        from importlib.metadata import version as installed

        typer.echo(f"labrig {installed('labrig')}")
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
