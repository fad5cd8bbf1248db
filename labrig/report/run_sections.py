"""Sections that do not depend on the protocol: bench, temperature, calibrations, budgets of σ."""

from collections.abc import Collection
from itertools import groupby

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.quantity import duration_text
from labrig.foundation.yaml_file import read_yaml
from labrig.record import (
    CALIBRATIONS_FILE,
    SMOOTHED_S,
    RunRecord,
    TemperatureHistory,
    degrees_text,
    frames_in_roles,
    glow_temperature_c,
    relative_rate_change,
)
from labrig.report.chart import Band, Chart, Line, Margins, Panel, Points, linear_axis
from labrig.report.figure_style import INK, MUTED, SHADE
from labrig.report.sections import Picture, Section, Table
from labrig.report.timing import moves_text
from labrig.results import UNDIVIDED, Budget, RunResult

HEIGHT_PT = 180.0
#: Longest run in s whose time axis is in minutes; that of longer runs is in hours.
MAX_IN_MINUTES_S = 3 * 3600.0
#: Smallest span of the temperature axis in °C, so that the noise of a steady room looks small.
MIN_SPAN_C = 2.0


def temperature_figure(
    time_s: FloatArray, celsius: FloatArray, smooth: FloatArray, glow_s: FloatArray
) -> Chart:
    """Return the chart of readings of the temperature and their smoothed course.

    Parameters
    ----------
    time_s
        Rising times of the readings in seconds after the start of the run, shape (n,).
    celsius
        Readings in °C, shape (n,).
    smooth
        Smoothed readings in °C, shape (n,).
    glow_s
        Begin and end of each shaded time of the glow in seconds after the start of the run, shape
        (m, 2).
    """
    unit_s, unit = (60.0, "min") if time_s[-1] <= MAX_IN_MINUTES_S else (3600.0, "h")
    middle = (float(celsius.min()) + float(celsius.max())) / 2
    reach = max(float(np.ptp(celsius)) * 1.1, MIN_SPAN_C) / 2
    low, high, last = middle - reach, middle + reach, float(time_s[-1]) / unit_s
    shades = tuple(
        Band(SHADE, span_s / unit_s, np.full(2, low), np.full(2, high), opacity=1.0)
        for span_s in glow_s
    )
    panel = Panel(
        linear_axis(f"Time since the run began / {unit}", -0.03 * last, 1.03 * last or 1.0),
        linear_axis("Temperature / °C", low, high, most=5),
        (
            *shades,
            Points(MUTED, time_s / unit_s, celsius, size_pt=1.3),
            Line(INK, time_s / unit_s, smooth),
        ),
        Margins(top=14.0),
    )
    return Chart((panel,), HEIGHT_PT)


def lamp_sections(run: RunRecord) -> tuple[Section, ...]:
    """Return the section on the lamp's relay and on the timing of lamp, shield and door.

    The section says whether anything but labrig switched the lamp, and how much later than planned
    lamp, shield and door moved.

    Parameters
    ----------
    run
        Journal of the run.

    Returns
    -------
    tuple of Section
        One section, or none if there is nothing to report.

    Examples
    --------
    >>> from pathlib import Path
    >>> import labrig
    >>> from labrig.report import lamp_sections
    >>> (section,) = lamp_sections(labrig.read_run(Path("runs/decay")))
    >>> print(section.text[0])
    Begun after its planned time: lamp off at most 0 ms, shield cover at most 5.2 ms (decay-1), door
    open at most 0 ms.
    """
    attempts = list(run.completed().values())
    text = []
    reads_back = [
        attempt.start.get("lamp_reads_back")
        for attempt in attempts
        if any(action.device == "lamp" for action in attempt.actions)
    ]
    if False in reads_back:
        text.append(
            "The lamp's relay board does not report its state: only the photographs can show "
            "whether something else switched the lamp while it charged."
        )
    elif True in reads_back:
        text.append(
            "The lamp's relay was read back about once a minute, and each time before it was "
            "switched: nothing else had switched it."
        )
    if moves := moves_text([action for attempt in attempts for action in attempt.actions]):
        text.append(moves)
    return (Section("Lamp, shield and door", tuple(text)),) if text else ()


def temperature_sections(run: RunRecord, roles: Collection[str]) -> tuple[Section, ...]:
    """Return the section on the temperature during a run.

    Parameters
    ----------
    run
        Journal of the run.
    roles
        Roles of the frames from which rates are fitted; their times are shaded in the figure.

    Returns
    -------
    tuple of Section
        One section with a figure of the readings, or none without a thermometer.

    Examples
    --------
    >>> from pathlib import Path
    >>> import labrig
    >>> from labrig.report import temperature_sections
    >>> (section,) = temperature_sections(labrig.read_run(Path("runs/decay")), {"decay"})
    >>> section.text[0].split(" (")[0]
    '20.7 °C to 20.8 °C over the run'
    """
    if not run.temperatures():
        return ()
    history, photographs = TemperatureHistory(run), frames_in_roles(run, roles)
    units = [list(group) for _, group in groupby(photographs, key=lambda frame: frame.unit)]
    run_start = run.attempts[0].start["time"]
    spans = [(unit[0].start_time, unit[-1].end_time) for unit in units]
    glow_s = np.array(spans).reshape(-1, 2) - run_start
    shaded = " Shaded: the glow from which rates are fitted." if len(glow_s) else ""
    picture = Picture(
        "temperature",
        temperature_figure(history.time - run_start, history.celsius, history.smooth, glow_s),
        f"Readings, and their means over five minutes (line).{shaded}",
    )
    text = (
        f"{degrees_text(history.smooth)} over the run ({len(history.time)} readings, smoothed over "
        f"{duration_text(SMOOTHED_S)})."
    )
    mean = glow_temperature_c(run, roles)
    if mean is not None:
        change = relative_rate_change(mean, mean + 1)
        text += (
            f" {mean:.1f} °C on average while the glow was photographed: k_r belongs to that "
            f"temperature, and rises by about {100 * change:.1f} % for a degree if traps are "
            "0.65 eV deep."
        )
    return (Section("Temperature", (text,), (picture,)),)


TEXT = (
    "The rig file names none of these: they were found beside the runs or the rig file, the newest "
    "ones of this bench."
)


def calibration_sections(run: RunRecord) -> tuple[Section, ...]:
    """Return the section on calibrations that were found beside the runs.

    Parameters
    ----------
    run
        A recorded run.

    Returns
    -------
    tuple of Section
        A table of their files and ages; empty if there were none.

    Raises
    ------
    UsageError
        The run's record of them is malformed.

    Examples
    --------
    >>> import labrig
    >>> from labrig.report import calibration_sections
    >>> calibration_sections(labrig.read_run("runs/decay"))
    ()
    """
    path = run.folder / CALIBRATIONS_FILE
    if not path.is_file():
        return ()
    found = read_yaml(path)
    rows = tuple(
        (kind.replace("_", " "), *(str(entry.get(key, "")) for key in ("made", "age", "file")))
        for kind, entry in found.items()
        if isinstance(entry, dict)
    )
    table = Table(("Calibration", "Made", "Age when the run began", "File"), rows)
    return (Section("Calibrations", (TEXT,), tables=(table,)),)


TITLE = "How far each number may be trusted"
#: Text of a component that is not included.
MISSING = "–"
#: Most budgets that are printed in the terminal.
MAX_LINES = 4
CAPTION = (
    "σ is the root of the sum of squares of its components; a dash is not included in it. A range "
    "by the model is beside σ and not in it."
)


def budget_sections(result: RunResult) -> tuple[Section, ...]:
    """Return the section with the budgets of a result; none where it has none."""
    budgets = result.budgets()
    if not budgets:
        return ()
    causes = [
        cause
        for cause in ("noise", "calibration", UNDIVIDED, "model")
        if any(cause in budget.components for budget in budgets.values())
    ]
    has_range = any(budget.model_range is not None for budget in budgets.values())
    head = (
        "Quantity",
        *(["Range by model"] if has_range else []),
        "Value ± σ",
        *(f"{cause[0].upper()}{cause[1:]}" for cause in causes),
        "Not included",
    )
    rows = tuple(
        (name, *([budget.model_text or MISSING] if has_range else []), *_cells(budget, causes))
        for name, budget in budgets.items()
    )
    return (Section(TITLE, tables=(Table(head, rows, CAPTION),)),)


def budget_lines(result: RunResult) -> tuple[str, ...]:
    """Return the budgets of a result as lines for the terminal, one per headline value.

    Of more than `MAX_LINES` values there is one line, which says that the report has them.
    """
    budgets = result.budgets()
    if len(budgets) > MAX_LINES:
        return (f"budgets of {len(budgets)} values are in the report",)
    return tuple(f"budget of {name}: {budget}" for name, budget in budgets.items())


def _cells(budget: Budget, causes: list[str]) -> tuple[str, ...]:
    """Return value, components and what is not included, a cell each."""
    parts = budget.components
    sizes = (budget.size_text(parts[cause]) if cause in parts else MISSING for cause in causes)
    return (budget.value_text, *sizes, ", ".join(budget.not_included) or "nothing named")
