"""`labrig fit`: fits of data from any source."""

from pathlib import Path
from typing import Annotated

import typer

from labrig.errors import UsageError

app = typer.Typer(help="Fit data from any source.")


@app.callback()
def fits() -> None:
    """Fit data from any source."""


@app.command("decay")
def decay(
    table: Annotated[
        Path,
        typer.Argument(
            help="series.csv of a run, or any table of times and values, with σ or not."
        ),
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
    column: Annotated[
        str | None, typer.Option("--column", help="Name of the column of values, of several.")
    ] = None,
    time: Annotated[str | None, typer.Option("--time", help="Name of the column of times.")] = None,
    time_unit: Annotated[
        str | None,
        typer.Option("--time-unit", help="Unit of the times: ns, ms, s, min, h, …"),
    ] = None,
    decimal: Annotated[
        str | None,
        typer.Option("--decimal", help="Decimal mark of the numbers, 'point' or 'comma'."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="Folder for result/: page, figures, fit.json, result.json."),
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Print fit.json.")] = False,
) -> None:
    """Rates and amplitudes of a sum of exponentials, with uncertainties.

    Columns, units, separators and decimal marks are found in the table. Without σ in the table, σ
    is taken from the scatter about the best monotone curve.
    """
    from labrig.analyse import TableFitOptions, fit_table
    from labrig.results import TableLayout

    if out is not None:
        _require_folder(out)
    options = TableFitOptions(states, offset, flicker, weights, origin, start)
    fitted = fit_table(table, options, TableLayout(time, column, time_unit, decimal))
    if not json:
        typer.echo(f"columns  {fitted[0].columns}")
    for part in fitted:
        fit = part.fit
        typer.echo(fit.to_json() if json else f"{part.region}\n{fit}".strip())
    if out is not None:
        from labrig.process import report_table

        processed = report_table(table, fitted, options, out)
        if not json:
            for line in processed.changes:
                typer.echo(line)
            typer.echo(f"report: {processed.report}")


def _require_folder(path: Path) -> None:
    """Refuse, before anything is fitted, a path at which no folder can be made."""
    nearest = next(place for place in (path, *path.parents) if place.exists())
    if not nearest.is_dir():
        raise UsageError(f"--out: expected a folder, got the file {nearest}; give another path")
