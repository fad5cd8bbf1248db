"""Effect of a run's temperature on its rates."""

from collections.abc import Collection, Iterable
from itertools import groupby

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.result_warning import Disturbance, ResultWarning, Unmeasured
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
from labrig.results import Measured

#: Change in K from which a warning is given: rates then change by 4 %, more than their usual σ.
MOVED_K = 0.5
#: Time over which a drift is looked for, least readings that tell it, and its significance in σ.
DRIFT_SEEN_S, MIN_READINGS, CLEAR_SIGMAS = 3600.0, 20, 5.0
#: Temperature of a room that nobody measured.
ROOM_C = 21.0
CHECK_IT = "check it before the next run (labrig rig check)"


def temperature_warnings(run: RunRecord, roles: Collection[str]) -> tuple[ResultWarning, ...]:
    """Warn of a temperature that changed while a sample glowed, and of a silent thermometer.

    Parameters
    ----------
    run
        A recorded run.
    roles
        Roles of the frames that show the glow.

    Returns
    -------
    tuple of ResultWarning
        The warnings; empty if the temperature was steady or no thermometer was there.

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
        return (
            Unmeasured(
                "no-temperature", "the thermometer gave no reading: {remedy}", remedy=CHECK_IT
            ),
        )
    course = TemperatureHistory(run)
    warnings: list[ResultWarning] = []
    for part, group in groupby(photographs, key=lambda frame: frame.unit.rpartition("/")[0]):
        temperatures_c = course.during(list(group))
        if temperatures_c.size and np.ptp(temperatures_c) >= MOVED_K:
            change = relative_rate_change(temperatures_c.min(), temperatures_c.max())
            warnings.append(
                Disturbance(
                    "temperature-moved",
                    "the temperature moved by {change_k:.1f} K while {glow} was photographed "
                    "({temperatures}): k_r changes by about {rate_change:.0%} over that, if traps "
                    "are 0.65 eV deep; keep the room steadier or measure for a shorter time",
                    change_k=np.ptp(temperatures_c),
                    glow=f"the glow of {part}" if part else "the glow",
                    temperatures=degrees_text(temperatures_c),
                    rate_change=change,
                )
            )
    if photographs[-1].end_time > course.time[-1] + KNOWN_FOR_S:
        warnings.append(
            Unmeasured(
                "temperature-ends",
                "the thermometer gave no reading after {last}: {remedy}",
                last=time_text(course.time[-1]),
                remedy=CHECK_IT,
            )
        )
    return tuple(warnings)


def drift_warnings(
    run: RunRecord, roles: Collection[str], rates: Iterable[Measured]
) -> tuple[ResultWarning, ...]:
    """Warn of a slow drift of the temperature that moves rates by more than their σ.

    While a sample glows for minutes its thermometer hardly shows a drift; the hour before does.

    Parameters
    ----------
    run
        A recorded run.
    roles
        Roles of the frames that show the glow.
    rates
        Fitted rates.
    """
    photographs, readings = frames_in_roles(run, roles), run.temperatures()
    if not photographs or len(readings) < MIN_READINGS:
        return ()
    first_s, last_s = photographs[0].start_time, photographs[-1].end_time
    near = [reading for reading in readings if -DRIFT_SEEN_S < reading.time - last_s < 0]
    time_s = np.array([reading.time for reading in near])
    celsius = np.array([reading.temperature_c for reading in near])
    if len(near) < MIN_READINGS or np.ptp(time_s) == 0:
        return ()
    (slope, _), covariance = np.polyfit(time_s - time_s.mean(), celsius, 1, cov=True)
    moved_k = float(slope) * (last_s - first_s)
    if abs(slope) < CLEAR_SIGMAS * np.sqrt(covariance[0, 0]) or abs(moved_k) >= MOVED_K:
        return ()
    middle_c = float(celsius.mean())
    change = abs(relative_rate_change(middle_c, middle_c + moved_k))
    sigmas = [rate.sigma / rate.value for rate in rates if 0 < rate.sigma < np.inf]
    if not sigmas or change / 2 < min(sigmas):
        return ()
    return (
        Disturbance(
            "temperature-drifts",
            "the temperature drifts by {drift_k_per_h:+.1f} K an hour, {change_k:+.2g} K while the "
            "glow was photographed: k_r changes by about {rate_change_percent:.1g} % over that, if "
            "traps are 0.65 eV deep, more than its σ of {rate_sigma_percent:.1g} %; rates are "
            "means over the decay, keep the room steadier to know them better",
            drift_k_per_h=3600 * slope,
            change_k=moved_k,
            rate_change_percent=100 * change,
            rate_sigma_percent=100 * min(sigmas),
        ),
    )


def drift_an_hour(run: RunRecord, effect_s: FloatArray) -> FloatArray | None:
    """Return what a drift of 1 K in an hour would change; None if the temperature was recorded.

    Parameters
    ----------
    run
        A recorded run.
    effect_s
        Relative changes of results if rates grow as 1 + γ t, over γ, in seconds.
    """
    if run.temperatures():
        return None
    return relative_rate_change(ROOM_C, ROOM_C + 1) / 3600 * effect_s


def at_temperature(material: Material, run: RunRecord, roles: Collection[str]) -> Material:
    """Return `material` with the mean temperature of such frames in its provenance, if known."""
    mean = glow_temperature_c(run, roles)
    if mean is None or material.provenance is None:
        return material
    provenance: Provenance = material.provenance.model_copy(update={"temperature_c": mean})
    return material.model_copy(update={"provenance": provenance})
