"""Result and report of another program's table, as those of a run."""

import hashlib
from collections.abc import Sequence
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path

from labrig.analyse import ChargeTableOptions, FittedTable, TableFitOptions
from labrig.foundation.input_file import MAX_TEXT_BYTES, read_bytes
from labrig.foundation.models import FrozenModel
from labrig.foundation.output_file import make_folder
from labrig.foundation.plugins import measurement
from labrig.foundation.yaml_file import write_yaml
from labrig.process.provenance import library_versions
from labrig.process.run import Processed, new_result, put_in_place
from labrig.process.without_run import describe_without_run
from labrig.report import Report, write_report
from labrig.results import DecayPatch, TableLayout, write_result


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


def stated(
    options: TableFitOptions | ChargeTableOptions, layout: TableLayout | None
) -> dict[str, str]:
    """Return what a person said of a fit and of its table, by name."""
    said = asdict(options) | (asdict(layout) if layout is not None else {})
    return {name: str(value) for name, value in said.items() if value is not None}


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
            f"{part.region}: {text}" if len(fitted) > 1 else text
            for part in fitted
            for text in part.fit.warnings
        ),
    )
    provenance = TableProvenance(
        labrig=version("labrig"),
        libraries=library_versions(),
        table=table.name,
        sha256=hashlib.sha256(read_bytes(table, MAX_TEXT_BYTES)).hexdigest(),
        options=stated(options, layout),
    )
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
