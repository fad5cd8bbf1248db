"""Result, page and material file of a fit to charge and decay of another program's table."""

import hashlib
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np

from labrig.analyse import ChargeTableOptions
from labrig.fit import ChargeFit, OrderState
from labrig.foundation.input_file import MAX_TEXT_BYTES, read_bytes
from labrig.foundation.output_file import make_folder, write_text
from labrig.foundation.yaml_file import write_yaml
from labrig.material import Material, Provenance, State, write_material
from labrig.process.provenance import library_versions
from labrig.process.run import new_result, put_in_place
from labrig.process.table import TableProvenance, stated
from labrig.process.without_run import describe_without_run
from labrig.report import charge_report, write_report
from labrig.results import TableLayout, write_csv


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
    checksum = hashlib.sha256(read_bytes(table, MAX_TEXT_BYTES)).hexdigest()
    provenance = TableProvenance(
        labrig=version("labrig"),
        libraries=library_versions(),
        table=table.name,
        sha256=checksum,
        options=stated(options, layout),
    )
    lamp = f"on at {options.on}, off at {options.off} by the table's clock"
    about = describe_without_run(
        table.stem, "charge", table.name, [("SHA-256", checksum), ("Lamp", lamp)]
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
    own = {"amplitude": amplitude.value, "amplitude_sigma": amplitude.sigma}
    if state.k_r_per_s is not None and state.r0 is not None:
        own |= {"r0": state.r0.value, "r0_sigma": state.r0.sigma}
        if order.value > 1:
            own |= {"kinetic_order": order.value, "kinetic_order_sigma": order.sigma}
        k_r = state.k_r_per_s
        return State(k_r_per_s=k_r.value, k_r_per_s_sigma=k_r.sigma, **own)
    rate = state.rate_at_off_per_s
    if order.value > 1 or not np.isfinite(rate.sigma):
        return None
    # Of first order, the decay alone tells k_r.
    return State(k_r_per_s=rate.value, k_r_per_s_sigma=rate.sigma, **own)
