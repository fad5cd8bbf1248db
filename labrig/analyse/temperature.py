"""Effect of a run's temperature on its rates."""

from collections.abc import Collection
from itertools import groupby

import numpy as np

from labrig.material import Material, Provenance
from labrig.record import (
    KNOWN_FOR_S,
    RunRecord,
    TemperatureHistory,
    degrees_text,
    frames_in_roles,
    glow_temperature_c,
    relative_rate_change,
    time_text,
)

#: Change in K from which a warning is given: rates then change by 4 %, more than their usual σ.
MOVED_K = 0.5
CHECK_IT = "check it before the next run (labrig rig check)"


def temperature_warnings(run: RunRecord, roles: Collection[str]) -> tuple[str, ...]:
    """Warn of a temperature that changed while a sample glowed, and of a silent thermometer.

    Parameters
    ----------
    run
        A recorded run.
    roles
        Roles of the frames that show the glow.

    Returns
    -------
    tuple of str
        The warnings, a line each; empty if the temperature was steady or no thermometer was there.

    Examples
    --------
    >>> import labrig
    >>> from labrig.analyse import temperature_warnings
    >>> run = labrig.read_run("runs/decay")
    >>> temperature_warnings(run, ["decay"])
    ()
    """
    photographs = frames_in_roles(run, roles)
    if not photographs or "thermometer" not in run.attempts[-1].start.get("devices", {}):
        return ()
    if not run.temperatures():
        return (f"the thermometer gave no reading: {CHECK_IT}",)
    course, warnings = TemperatureHistory(run), []
    for part, group in groupby(photographs, key=lambda frame: frame.unit.rpartition("/")[0]):
        temperatures_c = course.during(list(group))
        if temperatures_c.size and np.ptp(temperatures_c) >= MOVED_K:
            change = relative_rate_change(temperatures_c.min(), temperatures_c.max())
            glow = f"the glow of {part}" if part else "the glow"
            warnings.append(
                f"the temperature moved by {np.ptp(temperatures_c):.1f} K while {glow} was "
                f"photographed ({degrees_text(temperatures_c)}): k_r changes by about "
                f"{100 * change:.0f} % over that, if traps are 0.65 eV deep; keep the room "
                "steadier or measure for a shorter time"
            )
    if photographs[-1].end_time > course.time[-1] + KNOWN_FOR_S:
        warnings.append(
            f"the thermometer gave no reading after {time_text(course.time[-1])}: {CHECK_IT}"
        )
    return tuple(warnings)


def at_temperature(material: Material, run: RunRecord, roles: Collection[str]) -> Material:
    """Return `material` with the mean temperature of such frames in its provenance, if known."""
    mean = glow_temperature_c(run, roles)
    if mean is None or material.provenance is None:
        return material
    provenance: Provenance = material.provenance.model_copy(update={"temperature_c": mean})
    return material.model_copy(update={"provenance": provenance})
