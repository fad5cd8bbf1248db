"""Sections by which fits, series, materials and runs describe themselves, each by its type."""

from collections.abc import Iterator, Mapping, Sequence
from functools import partial, singledispatch
from itertools import islice
from typing import Any

import numpy as np

from labrig.design import Design
from labrig.fit import ChargeFit, MixtureFit
from labrig.foundation.arrays import FloatArray
from labrig.foundation.number_format import plus_minus, rounded
from labrig.foundation.plugins import measurement
from labrig.material import Material, MaterialComparison, ReradiationMatrix
from labrig.record import RunDescription, RunRecord, time_text
from labrig.report.charge import charge_report
from labrig.report.chart import Chart, Line, Panel, logarithmic_axis
from labrig.report.decay_figures import TIME_LABEL, linear_decay, logarithmic_decay
from labrig.report.design import design_figure
from labrig.report.figure_style import channel_colour
from labrig.report.material_tables import comparison_table, measured_table
from labrig.report.mixture import FittedMatrix, component_head, component_rows, components_text
from labrig.report.mixture_page import mixture_report
from labrig.report.parameters import (
    Row,
    candidate_rows,
    interval_tables,
    n_states_reason,
    quality_rows,
    state_rows,
)
from labrig.report.phosphor_picture import bands_figure, has_bands
from labrig.report.reradiation import describe_reradiation, reradiation_figure
from labrig.report.run_sections import calibration_sections, temperature_sections
from labrig.report.sections import Picture, Section, Table
from labrig.report.trap_depth import trap_depth_report
from labrig.results import (
    DecayPatch,
    FittedDecay,
    FluorescentPatch,
    Quantity,
    ResultWithDecays,
    Series,
    SharedDecay,
    StateDepth,
    TrapDepth,
    iter_quantities,
)

#: Rows of a CSV table that are shown, and single values of a result without a table of its own.
FIRST_ROWS, MAX_VALUES = 6, 60
ONE_SIGMA = "Value with its standard uncertainty (1 σ)."
HEIGHT_PT = 256.0
#: Number of points of a fitted curve, its first time over the last one, and its faintest light over
#: the brightest; lifetimes that are drawn where the times of the values are not at hand.
POINTS, SPAN, FAINTEST, LIFETIMES = 200, 1e-3, 1e-5, 5.0


@singledispatch
def sections_of(result: Any) -> tuple[Section, ...]:
    """Return the sections by which a result describes itself, without the run it belongs to.

    Parameters
    ----------
    result
        A fit, series, material, run, or any other result.

    Returns
    -------
    tuple of Section
        Tables and figures, the most important first; of a type that is not known here the first
        rows of its CSV tables, or the single values.

    Examples
    --------
    >>> import labrig
    >>> from labrig.report import sections_of
    >>> fit = labrig.read_result("runs/decay").patches["sample"].fit
    >>> [table.head for table in sections_of(fit)[0].tables][0]
    ('', 'State 1', 'State 2')
    """
    tables = tuple(_first_rows(result)) or tuple(_values(result))
    return (Section("Values", tables=tables),)


def _values(result: Any) -> Iterator[Table]:
    quantities = list(islice(iter_quantities(result), MAX_VALUES + 1))
    if not quantities:
        return
    rows = tuple(_value_row(each) for each in quantities[:MAX_VALUES])
    more = " The first ones; all others are in the table 'values'." * (len(quantities) > MAX_VALUES)
    yield Table(("Quantity", "Value", "Unit"), rows, ONE_SIGMA + more)


def _value_row(quantity: Quantity) -> tuple[str, str, str]:
    name = " ".join(quantity.path).replace("_", " ")
    if quantity.sigma is None:
        return name, rounded(quantity.value, 6), quantity.unit
    return name, plus_minus(quantity.value, quantity.sigma), quantity.unit


def _first_rows(result: Any) -> Iterator[Table]:
    """Yield the start of every CSV table."""
    for name, table in result.csv_tables().items():
        rows = [tuple(map(_cell, row)) for row in table.rows]
        more = f"The first of {len(rows)} rows." if len(rows) > FIRST_ROWS else ""
        yield Table(tuple(table.head), tuple(rows[:FIRST_ROWS]), more, name.removesuffix(".csv"))


def _cell(value: Any) -> str:
    try:
        return rounded(float(value), 6)
    except ValueError:
        return str(value)


@sections_of.register
def _(result: ResultWithDecays) -> tuple[Section, ...]:
    sections, _ = measurement("decay").load("table_report")(result, _about(result.kind))
    return tuple(sections)


@sections_of.register
def _(design: Design) -> tuple[Section, ...]:
    places = [f"place {number}" for number in range(1, int(design.keys.place.max()) + 2)]
    glow = Picture("glow", partial(design_figure, design, places))
    return (Section("Design", figures=(glow,), tables=tuple(_first_rows(design))),)


@sections_of.register
def _(patch: DecayPatch) -> tuple[Section, ...]:
    result = measurement("decay").load("result")(patches={patch.series.region or "decay": patch})
    return sections_of(result)


@sections_of.register
def _(series: Series) -> tuple[Section, ...]:
    figures = (
        Picture("logarithmic", logarithmic_decay(series, None)),
        Picture("linear", linear_decay(series, None)),
    )
    return (Section("Series", figures=figures, tables=tuple(_first_rows(series))),)


@sections_of.register
def _(fit: FittedDecay) -> tuple[Section, ...]:
    unit = fit.value_unit
    states = [f"State {number}" for number in range(1, fit.n_states + 1)]
    models = tuple(
        (row.model, row.reduced_chi2, row.bic_above_best, row.p_value)
        for row in candidate_rows(fit)
    )
    tables = (
        Table(("", *states), _rows(state_rows(fit, unit)), ONE_SIGMA),
        Table(("", "Value"), _rows(quality_rows(fit, unit)), title="Common parameters"),
        *interval_tables(fit.named_intervals),
        Table(
            ("Decay model", "Reduced χ²", "BIC", "p (F-test)"),
            models,
            n_states_reason(fit),
            "Number of states",
        ),
    )
    until_s = fit.measured_until_s
    t_s = np.geomspace(SPAN * until_s, until_s, POINTS)
    signals = dict(zip(fit.channels, fit.predict(t_s).T, strict=True))
    curve = _curves(t_s, signals, unit)
    return (Section("Decay", figures=(Picture("decay", curve),), tables=tables),)


def _rows(rows: Sequence[Row]) -> tuple[tuple[str, ...], ...]:
    return tuple((_with_unit(row.quantity, row.unit), *row.values) for row in rows)


def _with_unit(name: str, unit: str) -> str:
    return f"{name} / {f'({unit})' if '/' in unit else unit}" if unit else name


def _curves(t_s: FloatArray, signals: Mapping[str, FloatArray], unit: str) -> Chart:
    """Return the chart of fitted decays by name, as far as they are above 0."""
    peak = max(float(np.nanmax(signal)) for signal in signals.values())
    above = [signal[signal > FAINTEST * peak] for signal in signals.values()]
    low = min((float(signal.min()) for signal in above if len(signal)), default=FAINTEST)
    lines = [
        Line(channel_colour(name, number), t_s, np.maximum(signal, low / 2))
        for number, (name, signal) in enumerate(signals.items())
    ]
    panel = Panel(
        logarithmic_axis(TIME_LABEL, float(t_s[0]), float(t_s[-1])),
        logarithmic_axis(_with_unit("Signal", unit), low / 1.3, 1.3 * peak),
        tuple(lines),
    )
    return Chart((panel,), HEIGHT_PT, legend=tuple(zip(signals, lines, strict=True)))


@sections_of.register
def _(fit: SharedDecay) -> tuple[Section, ...]:
    tables = tuple(
        Table(tuple(head), tuple(map(tuple, rows)), "σ in units of the last places.")
        for head, *rows in (fit.rate_rows(), fit.table_rows())
    )
    slowest_s = 1 / min(rate.value for rate in fit.rates)
    t_s = np.geomspace(SPAN * slowest_s, LIFETIMES * slowest_s, POINTS)
    momentary = np.zeros(POINTS)
    curve = _curves(t_s, {each.name: each.predict(t_s, momentary) for each in fit.tables}, "")
    return (Section("Shared rates", figures=(Picture("decays", curve),), tables=tables),)


@sections_of.register
def _(depth: TrapDepth) -> tuple[Section, ...]:
    return trap_depth_report([StateDepth("", 1, depth)], _about("trap depth")).sections


@sections_of.register
def _(fit: ChargeFit) -> tuple[Section, ...]:
    return charge_report(fit, _about("charge")).sections


@sections_of.register
def _(fit: MixtureFit) -> tuple[Section, ...]:
    table = Table(component_head(fit), tuple(component_rows(fit)))
    return (Section("Mixture", (components_text(fit),), tables=(table,)),)


@sections_of.register
def _(matrix: ReradiationMatrix) -> tuple[Section, ...]:
    figure = Picture("matrix", partial(reradiation_figure, matrix, ()))
    points = tuple(line.strip() for line in describe_reradiation(matrix, ()).splitlines()[1:])
    return (Section("Re-radiation", figures=(figure,), points=points),)


@sections_of.register
def _(patch: FluorescentPatch) -> tuple[Section, ...]:
    values = Section("Values", tables=tuple(_values(patch)))
    return (*sections_of(patch.matrix.named("")), values)


@sections_of.register
def _(fitted: FittedMatrix) -> tuple[Section, ...]:
    return mixture_report(fitted, _about("mixture")).sections


@sections_of.register
def _(material: Material) -> tuple[Section, ...]:
    bands = Picture("bands", partial(bands_figure, material))
    figures = (bands,) if has_bands(material) else ()
    return (Section("Material", figures=figures, tables=(measured_table(material),)),)


@sections_of.register
def _(comparison: MaterialComparison) -> tuple[Section, ...]:
    return (Section("Comparison", points=comparison.notes, tables=(comparison_table(comparison),)),)


@sections_of.register
def _(run: RunRecord) -> tuple[Section, ...]:
    rows = tuple(
        (
            attempt.unit,
            time_text(float(attempt.start["time"])),
            str(len(attempt.frames)),
            attempt.exit_status or "not ended",
        )
        for attempt in run.attempts
    )
    table = Table(("Unit", "Began", "Frames", "Ended with"), rows)
    others = (*calibration_sections(run), *temperature_sections(run, frozenset()))
    return (Section("Attempts", tables=(table,)), *others)


def _about(kind: str) -> RunDescription:
    """Return the description of what belongs to no run; sections about results need no more."""
    return RunDescription(
        title="", protocol=kind, run="", started="", ended="", rig="", simulated=False,
        labrig_version="",
    )  # fmt: skip
