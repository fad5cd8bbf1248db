"""`labrig fit`: fits of data from any source."""

import shlex
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from labrig.cli.material import (
    LIGHTS,
    Corrected,
    Entry,
    Excitation,
    File,
    Lights,
    Pixel,
    Rows,
    checked,
    read_matrix,
)
from labrig.cli.screen import echo
from labrig.foundation.errors import DataError, UsageError

if TYPE_CHECKING:
    from labrig.analyse import TableFitOptions
    from labrig.results import TableLayout

#: Lights under which a mixture's colours are judged: near ultraviolet asks most of it.
MIXTURE_LIGHTS = (*LIGHTS, "395nm")

#: What a table leaves open about its columns, in every command that reads one.
Column = Annotated[
    str | None, typer.Option("--column", help="Name of the column of values, of several.")
]
Time = Annotated[str | None, typer.Option("--time", help="Name of the column of times.")]
TimeUnit = Annotated[
    str | None, typer.Option("--time-unit", help="Unit of the times: ns, ms, s, min, h, …")
]
Decimal = Annotated[
    str | None, typer.Option("--decimal", help="Decimal mark of the numbers, 'point' or 'comma'.")
]
TimePerChannel = Annotated[
    str | None,
    typer.Option("--time-per-channel", help="Width of a channel, '0.4 ns', if rows are channels."),
]
Block = Annotated[
    int | None, typer.Option("--block", min=1, help="Which table of the file, of several.")
]

app = typer.Typer(help="Fit data from any source.")


@app.callback()
def fits() -> None:
    """Fit data from any source."""


@app.command("decay")
def decay(
    tables: Annotated[
        list[Path],
        typer.Argument(
            help="series.csv of a run, or any table of times and values, with σ or not; several "
            "with --share."
        ),
    ],
    states: Annotated[
        int | None,
        typer.Option("--states", min=1, max=3, help="Number of states; chosen by default."),
    ] = None,
    law: Annotated[
        str,
        typer.Option(
            "--law",
            help="'auto', exponentials, becquerel, otor (one trap), stretched or rate-spectrum.",
        ),
    ] = "auto",
    at: Annotated[
        list[str] | None,
        typer.Option(
            "--at", help="Time such as '10 min' at which the signal is printed. Repeatable."
        ),
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
        typer.Option(
            "--weights",
            help="'given' σ, 'counts' (σ² = those expected, ≥ 5), or 'equal' (that of residuals).",
        ),
    ] = "given",
    origin: Annotated[
        str | None,
        typer.Option(
            "--origin", help="When the light went off, in the table's unit or as '5.5 min'."
        ),
    ] = None,
    start: Annotated[
        str | None,
        typer.Option(
            "--from", help="Use points from this time on, in the table's unit or as '2 ns'."
        ),
    ] = None,
    share: Annotated[
        str | None,
        typer.Option("--share", help="'rates': all tables have the same, each its amplitudes."),
    ] = None,
    intervals: Annotated[
        bool,
        typer.Option(
            "--intervals",
            help="Limits of every rate, lifetime and order at 68 and 95 % by profile likelihood, "
            "not only where σ misleads.",
        ),
    ] = False,
    column: Column = None,
    time: Time = None,
    time_unit: TimeUnit = None,
    decimal: Decimal = None,
    time_per_channel: TimePerChannel = None,
    block: Block = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="Folder for result/: page, figures, fit.json, result.json."),
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Print fit.json.")] = False,
) -> None:
    """Rates and amplitudes of a sum of exponentials, and other laws, with uncertainties.

    Columns, units, separators and decimal marks are found in the table. Without σ in the table, σ
    is taken from the scatter about the best monotone curve.
    """
    from labrig.analyse import TableFitOptions, fit_table
    from labrig.results import TableLayout

    if out is not None:
        _require_folder(out)
    times_s = [_time_s(text) for text in at or ()]
    options = TableFitOptions(states, offset, flicker, weights, origin, start, law, intervals)
    layout = TableLayout(time, column, time_unit, decimal, time_per_channel, block)
    if share is not None:
        _require_one_of("--share", share, ("rates",))
        if at:
            raise UsageError("--at: not with --share; fit a table by itself to print its signal")
        if intervals:
            raise UsageError("--intervals: not with --share; fit a table by itself to have them")
        _fit_shared(tables, options, layout, out, json)
        return
    if len(tables) > 1:
        raise UsageError(
            f"expected one table, got {len(tables)}; with '--share rates' all have the same rates"
        )
    (table,) = tables
    fitted = fit_table(table, options, layout)
    if not json:
        echo(f"columns  {fitted[0].columns}")
    for part in fitted:
        fit = part.fit
        if json:
            typer.echo(fit.to_json())
            continue
        echo(f"{part.region}\n{fit}".strip())
        if times_s:
            # Without a known lamp off, times count from the first row, as the amplitudes do.
            after_s = 0.0 if origin is None else part.series.clock.after_zero_s(origin)
            if origin is None and not fit.reference.is_lamp_off:
                echo(f"times count from {fit.reference}")
            echo(str(fit.forecast(times_s, after_s=after_s)))
    if out is not None:
        from labrig.process import report_table

        processed = report_table(table, fitted, options, out, layout)
        if not json:
            for line in processed.changes:
                echo(line)
            echo(f"report: {processed.report}")


def _fit_shared(
    tables: list[Path],
    options: "TableFitOptions",
    layout: "TableLayout",
    out: Path | None,
    json: bool,
) -> None:
    """Fit tables with shared rates, and print or write the result."""
    from labrig.analyse import fit_shared_tables

    shared, fitted = fit_shared_tables(tables, options, layout)
    if json:
        typer.echo(shared.to_json())
    else:
        for table, part in zip(shared.tables, fitted, strict=True):
            echo(f"{table.name}  {part.columns}")
        echo(str(shared))
    if out is None:
        return
    from labrig.process import report_shared_decay

    command = ["labrig", "fit", "decay", *map(str, tables), "--share", "rates"]
    given = {
        "--states": options.states,
        "--offset": options.offset,
        "--flicker": options.flicker,
        "--weights": options.weights,
        "--origin": options.origin,
        "--from": options.start,
        "--time": layout.time,
        "--column": layout.column,
        "--time-unit": layout.time_unit,
        "--decimal": layout.decimal,
        "--time-per-channel": layout.time_per_channel,
        "--block": layout.block,
    }
    for option, value in given.items():
        command += [] if value is None else [option, str(value)]
    series = [part.series for part in fitted]
    report = report_shared_decay(tables, shared, series, shlex.join(command), out)
    if not json:
        echo(f"report: {report}")


@app.command("charge")
def charge(
    table: Annotated[
        Path, typer.Argument(help="Table of times and one value, through charge and decay.")
    ],
    on: Annotated[
        str,
        typer.Option(
            "--on", help="When the lamp was switched on, in the table's unit or as '5.5 min'."
        ),
    ],
    off: Annotated[str, typer.Option("--off", help="When it was switched off, likewise.")],
    states: Annotated[
        int | None,
        typer.Option("--states", min=1, max=2, help="Number of states; chosen by default."),
    ] = None,
    order: Annotated[
        str,
        typer.Option("--order", help="Kinetic order: 'first', 'general', or 'auto' by the data."),
    ] = "auto",
    stimulated: Annotated[
        str,
        typer.Option(
            "--stimulated",
            help="η, fraction of the carriers that find their trap filled and recombine at once: "
            "0 to 1, or 'free'. 1 conserves energy.",
        ),
    ] = "1",
    intervals: Annotated[
        bool,
        typer.Option(
            "--intervals",
            help="Limits of every order, rate and lifetime at 68 and 95 % by profile likelihood, "
            "not only where σ misleads.",
        ),
    ] = False,
    column: Column = None,
    time: Time = None,
    time_unit: TimeUnit = None,
    decimal: Decimal = None,
    time_per_channel: TimePerChannel = None,
    block: Block = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="Folder for result/: page, figures, fit.json, material.yaml."),
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Print fit.json.")] = False,
) -> None:
    """States of general kinetic order that charge and decay as one series of readings does.

    The lamp is constant from --on to --off, and the sample was empty before. Without σ in the
    table, the variance is proportional to the value, and its size follows from the scatter of
    neighbours.
    """
    from labrig.analyse import ChargeTableOptions, fit_charge_table
    from labrig.results import TableLayout

    if out is not None:
        _require_folder(out)
    options = ChargeTableOptions(on, off, states, order, stimulated, intervals)
    layout = TableLayout(time, column, time_unit, decimal, time_per_channel, block)
    fit, columns = fit_charge_table(table, options, layout)
    if json:
        typer.echo(fit.to_json())
    else:
        echo(f"columns  {columns}\n{fit}")
    if out is None:
        return
    from labrig.process import report_charge

    reported = report_charge(table, fit, options, out, layout)
    if json:
        return
    for line in reported.changes:
        echo(line)
    echo(
        f"material: {reported.material}"
        if reported.material
        else "no material file: this charge does not separate k_r and r(0) of its states; "
        "fit.json has amplitude, τ and p after this charge"
    )
    echo(f"report: {reported.report}")


@app.command("luminance")
def luminance(
    table: Annotated[
        Path, typer.Argument(help="Table of times and luminances of an afterglow, with σ or not.")
    ],
    off: Annotated[
        str | None,
        typer.Option(
            "--off", help="When the light went off, in the table's unit or as '5.5 min'; else at 0."
        ),
    ] = None,
    unit: Annotated[
        str | None,
        typer.Option("--unit", help="Unit of the luminances, where the column's name has none."),
    ] = None,
    scale_sigma: Annotated[
        str, typer.Option("--scale-sigma", help="σ of the meter's calibration, such as '4 %'.")
    ] = "0 %",
    require: Annotated[
        list[str] | None,
        typer.Option("--require", help="Least luminance, '140 mcd/m2 at 10 min'. Repeatable."),
    ] = None,
    colours: Annotated[
        str, typer.Option("--colours", help="Letters of the colours for the marking, 'K-W'.")
    ] = "",
    excitation: Annotated[
        str,
        typer.Option("--excitation", help="Lamp, illuminance and time, as the output states them."),
    ] = "",
    column: Column = None,
    time: Time = None,
    time_unit: TimeUnit = None,
    decimal: Decimal = None,
    time_per_channel: TimePerChannel = None,
    block: Block = None,
    json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> None:
    """Luminances at 2, 10, 30 and 60 min, the time until 0.3 mcd/m², and the marking.

    Every luminance is that of the readings around its time; no law of decay is assumed. What was
    not measured is not stated: beyond the last reading there is only the range of the laws.
    """
    from labrig.analyse import LuminanceTableOptions, evaluate_luminance_table
    from labrig.results import TableLayout

    options = LuminanceTableOptions(
        unit, off, scale_sigma, tuple(require or ()), colours, excitation
    )
    layout = TableLayout(time, column, time_unit, decimal, time_per_channel, block)
    decay, columns = evaluate_luminance_table(table, options, layout)
    if json:
        typer.echo(decay.to_json())
    else:
        echo(f"columns  {columns}\n{decay}")


@app.command("mixture")
def mixture(
    file: File,
    components: Annotated[
        str, typer.Option("--components", help="Number of components, or 'auto'.")
    ] = "auto",
    scale: Annotated[
        str,
        typer.Option(
            "--scale",
            help="'integral': as much re-radiation as measured; 'least-squares': least error; "
            "'colour': least mean ΔE2000 under the lights.",
        ),
    ] = "integral",
    select: Annotated[
        str,
        typer.Option(
            "--select", help="How 'auto' finds the number: 'bic' or 'cross-validation' (slower)."
        ),
    ] = "bic",
    skewed: Annotated[
        bool,
        typer.Option("--skewed", help="Skewed components: eight numbers each instead of six."),
    ] = False,
    threshold: Annotated[
        float | None,
        typer.Option(
            "--threshold",
            help="Least value per band that counts as re-radiation; without it, by the noise: one "
            "in twenty of the numbers above it is noise.",
        ),
    ] = None,
    entry: Entry = None,
    pixel: Pixel = None,
    rows: Rows = None,
    excitation: Excitation = None,
    corrected: Corrected = False,
    light: Lights = None,
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder for fit.json, the page and its figures.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print fit.json.")] = False,
) -> None:
    """A mixture of normal densities that stands for a re-radiation matrix (Hua et al., 2021).

    The colours of the mixture, with the measured reflectance, are compared with those of the
    matrix.
    """
    from labrig.fit import fit_mixture
    from labrig.optics import read_light
    from labrig.report import FittedMatrix, describe_mixture

    number = _components(components)
    _require_one_of("--scale", scale, ("integral", "least-squares", "colour"))
    _require_one_of("--select", select, ("bic", "cross-validation"))
    if out is not None:
        _require_folder(out)
    names = light or MIXTURE_LIGHTS
    lights = tuple(read_light(name) for name in names)
    matrix = checked(file, read_matrix(file, entry, pixel, rows, excitation), corrected)
    fitting = partial(
        fit_mixture,
        matrix,
        scaling=scale,  # type: ignore[arg-type]
        threshold=threshold,
        selection=select,  # type: ignore[arg-type]
        skewed=skewed,
        lights=[read_light(name) for name in light or LIGHTS],
    )
    try:
        fit = fitting(number)
    except (UsageError, DataError) as error:
        raise type(error)(f"{file}: {error}") from None
    fitted = FittedMatrix(matrix, fit, lights)
    if as_json:
        typer.echo(fitted.to_json())
    else:
        echo(describe_mixture(fitted))
    if out is None:
        return
    from labrig.process import report_mixture

    if number != "auto":
        # The page compares the number that was asked for with those that "auto" would try.
        fitted = replace(fitted, others=fitting("auto").candidates)
    options = {
        "--components": components,
        "--scale": scale,
        "--select": select,
        "--threshold": threshold,
        "--entry": entry,
        "--pixel": pixel,
    }
    command = ["labrig", "fit", "mixture", file]
    for option, value in options.items():
        command += [] if value is None else [option, f"{value}"]
    command += ["--skewed"] if skewed else []
    command += ["--corrected"] if corrected else []
    for name in light or ():
        command += ["--light", name]
    report = report_mixture(Path(file), fitted, shlex.join(command), out)
    if not as_json:
        echo(f"report: {report}")


def _require_one_of(option: str, value: str, choices: tuple[str, ...]) -> None:
    if value not in choices:
        quoted = ", ".join(f"'{choice}'" for choice in choices)
        raise UsageError(f"{option}: expected one of {quoted}, got '{value}'")


def _time_s(text: str) -> float:
    from labrig.foundation.quantity import TIME_S, parse

    try:
        return parse(text, TIME_S)
    except ValueError as error:
        raise UsageError(f"--at: {error}") from None


def _components(text: str) -> "int | Literal['auto']":
    if text == "auto":
        return "auto"
    if not text.isdecimal() or int(text) == 0:
        raise UsageError(f"--components: expected a number from 1 on, or 'auto', got '{text}'")
    return int(text)


def _require_folder(path: Path) -> None:
    """Refuse, before anything is fitted, a path at which no folder can be made."""
    nearest = next(place for place in (path, *path.parents) if place.exists())
    if not nearest.is_dir():
        raise UsageError(f"--out: expected a folder, got the file {nearest}; give another path")
