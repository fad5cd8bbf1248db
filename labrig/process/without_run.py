"""Results and pages of what is no run: tables, charges, mixtures, studies of LEDs, trap depths."""

import hashlib
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np

from labrig.analyse import ChargeTableOptions, FittedTable, TableFitOptions
from labrig.fit import ChargeFit, OrderState
from labrig.foundation.input_file import MAX_TEXT_BYTES, read_bytes
from labrig.foundation.models import FrozenModel
from labrig.foundation.output_file import make_folder, write_text
from labrig.foundation.plugins import measurement
from labrig.foundation.yaml_file import write_yaml
from labrig.material import Material, Provenance, State, write_material
from labrig.process.provenance import library_versions
from labrig.process.run import Processed, new_result, put_in_place
from labrig.record import RunDescription
from labrig.report import (
    ComparedLeds,
    FittedMatrix,
    Report,
    charge_report,
    led_study_report,
    mixture_report,
    shared_decay_report,
    trap_depth_report,
    write_report,
)
from labrig.results import (
    DecayPatch,
    Series,
    SharedDecay,
    StateDepth,
    TableLayout,
    order_fields,
    trap_depths_json,
    write_csv,
    write_result,
)


def describe_without_run(
    title: str, protocol: str, source: str, sample: Sequence[tuple[str, str]]
) -> RunDescription:
    """Return the description of what was made from `source`, without time, rig and devices.

    Parameters
    ----------
    title
        Title of the page.
    protocol
        Kind of what was made, in place of a protocol.
    source
        Name of what it was made from.
    sample
        Names and values of properties.

    Returns
    -------
    RunDescription
        Description with the versions of labrig and its libraries.

    Examples
    --------
    >>> from labrig.process import describe_without_run
    >>> describe_without_run("paint", "table", "paint.csv", ()).run
    'paint.csv'
    """
    return RunDescription(
        title=title,
        protocol=protocol,
        run=source,
        started="",
        ended="",
        rig="",
        simulated=False,
        labrig_version=version("labrig"),
        libraries=tuple(library_versions().items()),
        sample=tuple(sample),
    )


def write_with_report(folder: Path, name: str, content: str, report: Report) -> Path:
    """Write a result and its page into a folder, made if there is none.

    Parameters
    ----------
    folder
        The folder.
    name
        Name of the result's file.
    content
        Text of the result.
    report
        The page.

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
    >>> from labrig.process import describe_without_run, write_with_report
    >>> from labrig.report import Report
    >>> about = describe_without_run("paint", "table", "paint.csv", ())
    >>> write_with_report(Path("paint"), "paint.json", "{}", Report(about)).as_posix()
    'paint/report.html'
    """
    page = folder / "report.html"
    make_folder(folder)
    write_text(folder / name, content + "\n")
    write_report(page, report)
    return page


class TableProvenance(FrozenModel):
    """Content of the `provenance.yaml` of a table's result.

    Attributes
    ----------
    labrig
        Version of labrig.
    libraries
        Versions of the libraries by name.
    table, sha256
        File name and checksum of the table.
    options
        Options of the fit and of the reading.
    """

    labrig: str
    libraries: dict[str, str]
    table: str
    sha256: str
    options: dict[str, str]


def _provenance(
    table: Path, options: TableFitOptions | ChargeTableOptions, layout: TableLayout | None
) -> TableProvenance:
    given = asdict(options) | (asdict(layout) if layout is not None else {})
    return TableProvenance(
        labrig=version("labrig"),
        libraries=library_versions(),
        table=table.name,
        sha256=_checksum(table),
        options={name: str(value) for name, value in given.items() if value is not None},
    )


def _checksum(file: Path) -> str:
    return hashlib.sha256(read_bytes(file, MAX_TEXT_BYTES)).hexdigest()


def report_table(
    table: Path,
    fitted: Sequence[FittedTable],
    options: TableFitOptions,
    folder: Path,
    layout: TableLayout | None = None,
) -> Processed:
    """Write the result and the report of a table to the folder `result` in `folder`.

    An earlier result that differs is kept as `result-1`, `result-2`, …, as that of a run is.

    Parameters
    ----------
    table
        Path of the table.
    fitted
        Fits of the table, by `labrig.analyse.fit_table`.
    options
        Options of the fit.
    folder
        Folder, made if there is none.
    layout
        Answers to what the table leaves open, as it was read with.

    Returns
    -------
    Processed
        Result, path of the report, and changes since the result before.

    Raises
    ------
    DiskError
        A file cannot be written.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.analyse import TableFitOptions, fit_table
    >>> from labrig.process import report_table
    >>> table, options = Path("series.csv"), TableFitOptions()
    >>> processed = report_table(table, fit_table(table, options), options, Path("my-decay"))
    >>> processed.report.as_posix()
    'my-decay/result/report.html'
    """
    decay = measurement("decay")
    result = decay.load("result")(
        patches={
            part.region or table.stem: DecayPatch(
                region=None,
                series=part.series,
                fit=part.fit,
                normalised_residuals=part.fit.normalised_residuals,
            )
            for part in fitted
        },
        states_requested=options.states,
        warnings=tuple(
            warning.about(part.region if len(fitted) > 1 else "")
            for part in fitted
            for warning in part.fit.warnings
        ),
    )
    provenance = _provenance(table, options, layout)
    sample = [("SHA-256", provenance.sha256), *_uncertainties(fitted)]
    about = describe_without_run(table.stem, "decay", table.name, sample)
    sections, methods = decay.load("table_report")(result, about)
    make_folder(folder)
    result_folder = new_result(folder)
    write_yaml(result_folder / "provenance.yaml", provenance)
    write_result(result_folder, result)
    report = Report(about, result.warnings, sections, methods)
    write_report(result_folder / "report.html", report)
    changes = put_in_place(result_folder)
    return Processed(result, folder / "result" / "report.html", (), changes)


def _uncertainties(fitted: Sequence[FittedTable]) -> tuple[tuple[str, str], ...]:
    """Return where the uncertainties of the values came from."""
    fit = fitted[0].fit
    return (("σ of the values", str(fit.scatter or f"of {fit.sigma_origin}")),)


@dataclass(frozen=True)
class ReportedCharge:
    """Files of a fit to charge and decay.

    Attributes
    ----------
    report
        Path of the page.
    material
        Path of the material file; None where charge and decay do not tell all that it needs.
    changes
        Changes since the result before, in lines for people.
    """

    report: Path
    material: Path | None
    changes: tuple[str, ...]


def report_charge(
    table: Path,
    fit: ChargeFit,
    options: ChargeTableOptions,
    folder: Path,
    layout: TableLayout | None = None,
) -> ReportedCharge:
    """Write the result and the report of charge and decay to the folder `result` in `folder`.

    An earlier result that differs is kept as `result-1`, `result-2`, …, as that of a run is.

    Parameters
    ----------
    table
        Path of the table.
    fit
        Its fit, by `labrig.analyse.fit_charge_table`.
    options
        Options of the fit.
    folder
        Folder, made if there is none.
    layout
        Answers to what the table leaves open, as it was read with.

    Returns
    -------
    ReportedCharge
        Path of the page and of the material file, and changes since the result before.

    Raises
    ------
    DiskError
        A file cannot be written.

    Examples
    --------
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from labrig.analyse import ChargeTableOptions, fit_charge_table
    >>> from labrig.process import report_charge
    >>> t_s = np.arange(1.0, 300.0, 2.0)
    >>> light = np.where(t_s < 100, 1 - np.exp(-t_s / 30), np.exp(-(t_s - 100) / 30))
    >>> counts = np.random.default_rng(1).poisson(1e4 * light)
    >>> table = Path("glow.csv")
    >>> np.savetxt(table, np.transpose([t_s, counts]), header="t_s counts", comments="")
    >>> options = ChargeTableOptions(on="0", off="100", states=1, order="first", stimulated="0")
    >>> fit, _ = fit_charge_table(table, options)
    >>> reported = report_charge(table, fit, options, Path("glow"))
    >>> sorted(path.name for path in reported.report.parent.iterdir())  # doctest: +ELLIPSIS
    ['figures', 'fit.json', 'material.yaml', 'provenance.yaml', 'readings.csv', 'report.html']
    """
    provenance = _provenance(table, options, layout)
    lamp = f"on at {options.on}, off at {options.off} by the table's clock"
    about = describe_without_run(
        table.stem, "charge", table.name, [("SHA-256", provenance.sha256), ("Lamp", lamp)]
    )
    material = _material(table, fit)
    make_folder(folder)
    part = new_result(folder)
    write_text(part / "fit.json", fit.to_json() + "\n")
    _write_readings(part / "readings.csv", fit)
    write_yaml(part / "provenance.yaml", provenance)
    if material is not None:
        write_material(part / "material.yaml", material)
    write_report(part / "report.html", charge_report(fit, about))
    changes = put_in_place(part)
    result = folder / "result"
    return ReportedCharge(
        result / "report.html", result / "material.yaml" if material else None, changes
    )


def _write_readings(path: Path, fit: ChargeFit) -> None:
    """Write what was fitted, with σ and the light of the fit."""
    readings = fit.readings
    columns = (readings.t_s, readings.values, readings.sigma, readings.light)
    header = ("t_after_lamp_on_s", "value", "value_sigma", "fit")
    rows = ([f"{number:.9g}" for number in row] for row in zip(*columns, strict=True))
    write_csv(path, header, rows)


def _material(table: Path, fit: ChargeFit) -> Material | None:
    """Return the material; None if a state of general order is known after this charge only."""
    states = [_state(state) for state in fit.states]
    known = [state for state in states if state is not None]
    if len(known) < len(states):
        return None
    note = f"amplitudes are those after a charge of {fit.charge_s:g} s"
    return Material(
        name=table.stem,
        kind="phosphor",
        states=tuple(known),
        provenance=Provenance(
            source=f"charge and decay in {table.name}", version=version("labrig"), note=note
        ),
    )


def _state(state: OrderState) -> State | None:
    """Return a state of the material; None if its k_r and r(0) are not known apart."""
    amplitude, order = state.amplitude, state.order
    own = {"amplitude": amplitude.value, "amplitude_sigma": amplitude.sigma, **order_fields(order)}
    if state.k_r_per_s is not None and state.r0 is not None:
        own |= {"r0": state.r0.value, "r0_sigma": state.r0.sigma}
        k_r = state.k_r_per_s
        return State(k_r_per_s=k_r.value, k_r_per_s_sigma=k_r.sigma, **own)
    rate = state.rate_at_off_per_s
    if order.value > 1 or not np.isfinite(rate.sigma):
        return None
    # Of first order, the decay alone tells k_r.
    return State(k_r_per_s=rate.value, k_r_per_s_sigma=rate.sigma, **own)


def report_shared_decay(
    tables: Sequence[Path],
    fit: SharedDecay,
    series: Sequence[Series],
    command: str,
    folder: Path,
) -> Path:
    """Write `fit.json` and the page of several tables with shared rates.

    Parameters
    ----------
    tables
        Paths of the tables.
    fit, series
        Their fit and series, by `labrig.analyse.fit_shared_tables`.
    command
        Command that does the same again.
    folder
        Folder, made if there is none; earlier files of the same names in its `result` are replaced.

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
    >>> import numpy as np
    >>> from labrig.analyse import TableFitOptions, fit_shared_tables
    >>> from labrig.process import report_shared_decay
    >>> t_s, rng = np.linspace(0, 50, 60), np.random.default_rng(1)
    >>> paths = [Path("dim.csv"), Path("bright.csv")]
    >>> for path, level in zip(paths, (100, 400)):
    ...     values = level * np.exp(-0.1 * t_s) + rng.standard_normal(60)
    ...     table = np.transpose([t_s, values])
    ...     np.savetxt(path, table, delimiter=",", header="t_s,y", comments="")
    >>> fit, tables = fit_shared_tables(paths, TableFitOptions())
    >>> series = [table.series for table in tables]
    >>> report_shared_decay(paths, fit, series, "labrig fit decay", Path("both")).as_posix()
    'both/result/report.html'
    """
    checksums = ((f"SHA-256 of {table.name}", _checksum(table)) for table in tables)
    sample = [*checksums, ("Command", command)]
    names = ", ".join(table.name for table in tables)
    about = describe_without_run(f"{len(tables)} tables with shared rates", "decay", names, sample)
    report = shared_decay_report(fit, series, about)
    return write_with_report(folder / "result", "fit.json", fit.to_json(), report)


def report_mixture(file: Path, fitted: FittedMatrix, command: str, folder: Path) -> Path:
    """Write `fit.json` and the report of a mixture into a folder.

    Parameters
    ----------
    file
        Path of the matrix's file.
    fitted
        The matrix and its mixture.
    command
        Command that does the same again.
    folder
        Folder, made if there is none; earlier files of the same names are replaced.

    Returns
    -------
    Path
        Path of the report.

    Raises
    ------
    DiskError
        A file cannot be written.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.fit import fit_mixture
    >>> from labrig.material import read_reradiation
    >>> from labrig.process import report_mixture
    >>> from labrig.report import FittedMatrix
    >>> paper = read_reradiation("paper.csv")
    >>> fitted = FittedMatrix(paper, fit_mixture(paper, 2, threshold=1e-3))
    >>> command = "labrig fit mixture paper.csv --components 2 --threshold 0.001"
    >>> report_mixture(Path("paper.csv"), fitted, command, Path("mixture")).as_posix()
    'mixture/report.html'
    """
    sample = [("SHA-256", _checksum(file)), ("Command", command)]
    about = describe_without_run(fitted.matrix.name, "mixture", file.name, sample)
    return write_with_report(folder, "fit.json", fitted.to_json(), mixture_report(fitted, about))


def report_led_study(compared: ComparedLeds, command: str, folder: Path) -> Path:
    """Write `led_study.json` and the page of a comparison of sets of LEDs into a folder.

    Parameters
    ----------
    compared
        The sets of LEDs.
    command
        Command that does the same again.
    folder
        Folder, made if there is none; earlier files of the same names are replaced.

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
    >>> import numpy as np
    >>> from labrig.fit.fluorescence import LedSet, LedStudy
    >>> from labrig.process import report_led_study
    >>> from labrig.report import ComparedLeds
    >>> study = LedStudy(("felt", "paper"), ("D65",), np.array([[0.5], [1.0]]))
    >>> compared = ComparedLeds((LedSet("even", (400, 500, 600), study),), "mine", "2 papers")
    >>> report_led_study(compared, "labrig leds study --number 3", Path("leds")).as_posix()
    'leds/report.html'
    """
    about = describe_without_run(
        "How many LEDs, and where", "led_study", compared.of_surfaces, [("Command", command)]
    )
    page = led_study_report(compared, about)
    return write_with_report(folder, "led_study.json", compared.to_json(), page)


def report_trap_depths(depths: Sequence[StateDepth], runs: Sequence[str], folder: Path) -> Path:
    """Write `trap_depth.json` and the page of trap depths into a folder.

    Parameters
    ----------
    depths
        Depths of the states; not empty.
    runs
        Names of the runs that they were made of.
    folder
        Folder, made if there is none; earlier files of the same names are replaced.

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
    >>> from labrig.fit import fit_trap_depth
    >>> from labrig.process import report_trap_depths
    >>> from labrig.results import StateDepth
    >>> depth = fit_trap_depth([15, 21, 27], [0.030, 0.048, 0.074], [0.001, 0.001, 0.002])
    >>> report_trap_depths([StateDepth("", 1, depth)], ["a", "b", "c"], Path("depth")).as_posix()
    'depth/report.html'
    """
    about = describe_without_run("Trap depths", "trap_depth", ", ".join(runs), ())
    content = trap_depths_json(tuple(depths), tuple(runs))
    return write_with_report(folder, "trap_depth.json", content, trap_depth_report(depths, about))
