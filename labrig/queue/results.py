"""How far a queue is, and what its runs found: entries, a table, and a page."""

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import groupby
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from labrig.acquire import read_run_protocol
from labrig.catalogue import RunSummary, summarise
from labrig.fit import fit_power_law
from labrig.foundation.errors import FitError, LabrigError
from labrig.foundation.quantity import duration_text
from labrig.foundation.result_warning import ResultWarning, Unmeasured
from labrig.process import describe_without_run, write_with_report
from labrig.queue.queue_file import Queue, QueuedRun
from labrig.report import Picture, Report, Section, SweptPoint, Table, sweep_chart
from labrig.results import MCD_PER_M2, Measured, read_fitted_decay, read_result
from labrig.text_table import table_text


@dataclass(frozen=True)
class FoundLuminance:
    """A luminance at one time after lamp off.

    Attributes
    ----------
    patch
        Name of the patch.
    t_s
        Time after lamp off in seconds.
    luminance
        Luminance in mcd/m².
    scale_sigma
        Part of its relative σ that luminances of one bench have in common.
    """

    patch: str
    t_s: float
    luminance: Measured
    scale_sigma: float


def found_luminances(run: Path) -> Iterator[FoundLuminance]:
    """Iterate over the luminances of a processed run; none of a run of another protocol."""
    try:
        result = read_result(run)
    except LabrigError:
        return
    for name, decay in result.provides().get("luminances", {}).items():
        for entry in decay.at:
            if entry.luminance is not None:
                yield FoundLuminance(name, entry.t_s, entry.luminance, decay.scale_sigma)


#: Name of the figure, what it shows, label of its axis, and the quantity.
SWEPT: tuple[tuple[str, str, str, Callable[["FoundState"], Measured]], ...] = (
    ("rates-{}", "Decay rates", "k_r / s⁻¹", lambda state: state.k_r_per_s),
    ("amplitudes-{}", "Amplitudes at lamp off", "Amplitude", lambda state: state.amplitude),
)
#: Caption of the figure of luminances.
LUMINANCES = "Luminances at times after lamp off over {}. Bars are ± 1 σ, with the scale's."
#: Heads of the table of slopes, and what it shows.
SLOPE_HEAD = ("Quantity", "slope", "p")
SLOPES = (
    "Slopes with both axes logarithmic, d ln(quantity)/d ln(key), with σ in units of the last "
    "places: 1 is proportional. p is the probability of values further from one slope."
)
#: Probability below which one slope does not describe the values.
NO_SLOPE = 0.01
#: Status before the run, beside those of runs.
WAITING = "waiting"


@dataclass(frozen=True)
class FoundState:
    """An exponential of a decay.

    Attributes
    ----------
    patch
        Folder of the fit within the result; empty of the only one.
    number
        Number of the state, from 1.
    k_r_per_s, amplitude
        Rate, and signal at lamp off in the unit of the values.
    """

    patch: str
    number: int
    k_r_per_s: Measured
    amplitude: Measured


@dataclass(frozen=True)
class QueueEntry:
    """A measurement of a queue and its run.

    Attributes
    ----------
    number
        Number in the queue, from 1.
    queued
        The measurement.
    summary
        Summary of the run; None before it.
    """

    number: int
    queued: QueuedRun
    summary: RunSummary | None

    @property
    def status(self) -> str:
        """`waiting`, or the status of the run."""
        return WAITING if self.summary is None else self.summary.status

    @cached_property
    def states(self) -> tuple[FoundState, ...]:
        """States of the decays that the run found."""
        return tuple(self._states())

    def _states(self) -> Iterator[FoundState]:
        if self.summary is None:
            return
        for patch in self.summary.parameters:
            fit = read_fitted_decay(self.summary.folder / "result" / patch / "fit.json")
            for number, state in enumerate(fit.states_at_lamp_off, 1):
                yield FoundState(
                    patch,
                    number,
                    Measured(state.k_r_per_s, state.k_r_per_s_sigma),
                    Measured(state.amplitude, state.amplitude_sigma),
                )

    @cached_property
    def luminances(self) -> tuple[FoundLuminance, ...]:
        """Luminances that the run found."""
        if self.summary is None or self.status != "processed":
            return ()
        return tuple(found_luminances(self.summary.folder))

    @cached_property
    def warnings(self) -> tuple[ResultWarning, ...]:
        """Warnings of the run's result."""
        if self.summary is None or self.status != "processed":
            return ()
        try:
            return read_result(self.summary.folder).warnings
        except LabrigError as error:
            return (Unmeasured("result-unreadable", "{reason}", reason=str(error)),)

    def value(self, key: str) -> float:
        """Return the value of a key in the run's protocol in its unit; NaN if it is no number."""
        if self.summary is None:
            return np.nan
        try:
            value: Any = read_run_protocol(self.summary.folder)
        except LabrigError:
            return np.nan
        for name in key.split("."):
            value = getattr(value, name, None)
        return float(value) if isinstance(value, int | float) else np.nan


def entries(queue: Queue, runs: Path) -> list[QueueEntry]:
    """Return the measurements of a queue and how far they are.

    Parameters
    ----------
    queue
        The queue.
    runs
        Folder with the run folders.

    Returns
    -------
    list of QueueEntry
        An entry for each, in order.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.queue import Queue, QueuedRun, entries
    >>> queue = Queue(runs=(QueuedRun(protocol="decay", run="decay"), QueuedRun(protocol="decay")))
    >>> [entry.status for entry in entries(queue, Path("runs"))]
    ['processed', 'waiting']
    """
    return [
        QueueEntry(number, queued, _summary(queued, runs))
        for number, queued in enumerate(queue.runs, 1)
    ]


def _summary(queued: QueuedRun, runs: Path) -> RunSummary | None:
    """Return the summary of a run; None without one, as if it was removed."""
    if queued.run is None or not (runs / queued.run).is_dir():
        return None
    return summarise(runs / queued.run).at_present()


def write_results(folder: Path, name: str, listed: Sequence[QueueEntry]) -> Path:
    """Write the results of a queue as `results.csv` and as a page.

    Parameters
    ----------
    folder
        Folder, made if there is none.
    name
        Name of the queue.
    listed
        Its entries.

    Returns
    -------
    Path
        Path of the page.

    Raises
    ------
    DiskError
        A file cannot be written.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.queue import Queue, QueuedRun, entries, write_results
    >>> listed = entries(Queue(runs=(QueuedRun(protocol="decay", run="decay"),)), Path("runs"))
    >>> write_results(Path("queue-results"), "queue", listed).name
    'report.html'
    >>> print(Path("queue-results/results.csv").read_text().splitlines()[1])
    1,decay,processed,decay,,1,0.20476...
    """
    report = queue_report(name, listed, folder)
    return write_with_report(folder, "results.csv", _csv(listed), report)


def _csv(listed: Sequence[QueueEntry]) -> str:
    """Return a line for each rate and luminance of each run, and one of a run that found none."""
    keys = _keys(listed)
    found = ["k_r_per_s", "k_r_per_s_sigma", "amplitude", "amplitude_sigma"]
    luminous = any(entry.luminances for entry in listed)
    light = ["t_s", "luminance_mcd_per_m2", "luminance_mcd_per_m2_sigma"] if luminous else []
    head = ["number", "protocol", *keys, "status", "run", "patch", "state", *found, *light]
    table: list[list[object]] = []
    for entry in listed:
        queued = entry.queued
        start = [entry.number, queued.protocol, *(queued.changes.get(key, "") for key in keys)]
        start += [entry.status, queued.run or ""]
        rows: list[list[object]] = [
            [state.patch, state.number, k_r.value, k_r.sigma, amplitude.value, amplitude.sigma]
            for state in entry.states
            for k_r, amplitude in [(state.k_r_per_s, state.amplitude)]
        ]
        rows += [
            [one.patch, *[""] * (1 + len(found)), one.t_s, one.luminance.value, one.luminance.sigma]
            for one in entry.luminances
        ]
        for cells in rows or [[]]:
            table.append([*start, *cells, *[""] * (len(head) - len(start) - len(cells))])
    return table_text(head, table).rstrip("\n")


def _keys(listed: Sequence[QueueEntry]) -> list[str]:
    """Return the keys that are changed in any run."""
    return list(dict.fromkeys(key for entry in listed for key in entry.queued.changes))


def queue_report(name: str, listed: Sequence[QueueEntry], folder: Path = Path()) -> Report:
    """Return the page of a queue: its runs, their rates, and rates over what was swept.

    Parameters
    ----------
    name
        Name of the queue.
    listed
        Its entries.
    folder
        Folder of the page, from which it leads to the runs' reports.

    Returns
    -------
    Report
        The page.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.queue import Queue, QueuedRun, entries, queue_report
    >>> listed = entries(Queue(runs=(QueuedRun(protocol="decay", run="decay"),)), Path("runs"))
    >>> report = queue_report("queue", listed)
    >>> report.sections[0].tables[0].rows[0][-1]
    '0.2048(31), 0.01009(12)'
    """
    keys = _keys(listed)
    rows = [
        (
            str(entry.number),
            entry.queued.protocol,
            *(str(entry.queued.changes.get(key, "")) for key in keys),
            entry.status,
            entry.queued.run or "",
            str(len(entry.warnings) or ""),
            "; ".join(_rates(entry)),
        )
        for entry in listed
    ]
    head = ("no.", "protocol", *keys, "status", "run", "warnings", "k_r / s⁻¹")
    caption = "Rates with σ in units of the last places, falling; patches are separated by ;."
    links = tuple(_report_of(entry, folder) for entry in listed)
    runs = Section("Runs", tables=(Table(head, tuple(rows), caption, links=links),))
    figures = tuple(
        Picture(name.format(n), chart, f"{what} over {key}. Bars are ± 1 σ.")
        for n, key in enumerate(keys, 1)
        for name, what, label, quantity in SWEPT
        for texts, points in [_swept(listed, key, partial(_of_states, quantity))]
        if (chart := sweep_chart(key, texts, label, points)) is not None
    )
    luminous = [(key, n, *_luminances_over(listed, key)) for n, key in enumerate(keys, 1)]
    figures += tuple(
        Picture(f"luminances-{n}", chart, LUMINANCES.format(key))
        for key, n, texts, points in luminous
        if (chart := sweep_chart(key, texts, f"L / {MCD_PER_M2}", points)) is not None
    )
    slopes = [row for key in keys for row in _slopes_of_states(listed, key)]
    scale = max((one.scale_sigma for entry in listed for one in entry.luminances), default=0.0)
    slopes += [
        row for key, _, _, points in luminous for row in _slopes("Luminance", key, points, scale)
    ]
    tables = (Table(SLOPE_HEAD, tuple(slopes), SLOPES),) if slopes else ()
    swept = (Section("Over the changed keys", figures=figures, tables=tables),) if figures else ()
    about = describe_without_run(name, "queue", "", ())
    warnings = [
        warning.about(f"no. {entry.number}") for entry in listed for warning in entry.warnings
    ]
    return Report(about, tuple(warnings), (runs, *swept))


def _luminances_over(
    listed: Sequence[QueueEntry], key: str
) -> tuple[dict[float, str], list[SweptPoint]]:
    """Return the values of a key, as `_swept` does, and luminances at the times of the table."""
    return _swept(
        listed,
        key,
        lambda entry: [
            (one.patch, duration_text(one.t_s), one.luminance) for one in entry.luminances
        ],
    )


def _report_of(entry: QueueEntry, folder: Path) -> str:
    """Return the address of a run's report from the page; empty without one."""
    report = None if entry.summary is None else entry.summary.folder / "result" / "report.html"
    if report is None or not report.is_file():
        return ""
    return quote(Path(os.path.relpath(report.resolve(), folder.resolve())).as_posix())


def _rates(entry: QueueEntry) -> list[str]:
    return [
        ", ".join(str(state.k_r_per_s) for state in of_patch)
        for _, of_patch in groupby(entry.states, key=lambda state: state.patch)
    ]


def _slopes_of_states(listed: Sequence[QueueEntry], key: str) -> Iterator[tuple[str, str, str]]:
    for _, what, _, quantity in SWEPT:
        _, points = _swept(listed, key, partial(_of_states, quantity))
        yield from _slopes(what, key, points)


def _slopes(
    what: str, key: str, points: Sequence[SweptPoint], common_sigma: float = 0.0
) -> Iterator[tuple[str, str, str]]:
    """Iterate over the slopes of quantities over a key, in logarithms, where they are told."""
    for patch, name in dict.fromkeys((point.patch, point.name) for point in points):
        own = [point for point in points if (point.patch, point.name) == (patch, name)]
        try:
            law = fit_power_law(
                [point.at for point in own], [point.measured for point in own], common_sigma
            )
        except FitError:
            continue
        slope = f"{law.exponent}{'' if law.p_value >= NO_SLOPE else ', not one slope'}"
        quantity = ", ".join(filter(None, (what, name, patch, f"over {key}")))
        yield quantity, slope, f"{law.p_value:.2g}"


def _of_states(
    quantity: Callable[[FoundState], Measured], entry: QueueEntry
) -> list[tuple[str, str, Measured]]:
    return [(state.patch, f"state {state.number}", quantity(state)) for state in entry.states]


def _swept(
    listed: Sequence[QueueEntry],
    key: str,
    quantities: Callable[[QueueEntry], Sequence[tuple[str, str, Measured]]],
) -> tuple[dict[float, str], list[SweptPoint]]:
    """Return the values of a key, as typed by their numbers, and quantities of all runs.

    Parameters
    ----------
    listed, key
        Entries of the queue, and the key.
    quantities
        Function of an entry that returns patch, name and value of its quantities.
    """
    of_key = [entry for entry in listed if key in entry.queued.changes]
    values = {entry.number: entry.value(key) for entry in of_key}
    known = [entry for entry in of_key if not np.isnan(values[entry.number])]
    texts = {values[entry.number]: str(entry.queued.changes[key]) for entry in known}
    return texts, [
        SweptPoint(values[entry.number], patch, name, measured)
        for entry in known
        for patch, name, measured in quantities(entry)
    ]
