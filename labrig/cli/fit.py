"""`labrig fit`: fits of data from any source."""

from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(help="Fit data from any source.")


@app.callback()
def fits() -> None:
    """Fit data from any source."""


@app.command("decay")
def decay(
    series: Annotated[
        Path,
        typer.Argument(help="series.csv of a run, or a table of time, value and optionally sigma."),
    ],
    states: Annotated[
        int | None,
        typer.Option("--states", min=1, max=3, help="Number of states; chosen by default."),
    ] = None,
    offset: Annotated[
        str, typer.Option("--offset", help="'zero', 'free', or the σ of a constant background.")
    ] = "zero",
    flicker: Annotated[
        str,
        typer.Option("--flicker", help="'auto', or frame-to-frame scatter such as '0.7 %' or 0."),
    ] = "auto",
    weights: Annotated[
        str,
        typer.Option("--weights", help="'given' σ, or 'counts' (σ² = counts, at least 5)."),
    ] = "given",
    origin: Annotated[
        float, typer.Option("--origin", help="Time at which the light went off, in seconds.")
    ] = 0.0,
    start: Annotated[
        float | None, typer.Option("--from", help="Use points from this time on, in seconds.")
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Print fit.json.")] = False,
) -> None:
    """Rates and amplitudes of a sum of exponentials, with uncertainties."""
    from labrig.analyse import fit_table

    for name, fit in fit_table(series, states, offset, flicker, weights, origin, start):
        typer.echo(fit.to_json() if json else f"{name}\n{fit}".strip())
