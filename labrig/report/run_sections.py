"""What a report says of a run whatever it measured: lamp, shield and door; the temperature."""

from collections.abc import Collection
from functools import partial
from itertools import groupby

import numpy as np

from labrig.quantity import duration_text
from labrig.record import (
    SMOOTHED_S,
    Course,
    RunRecord,
    degrees_text,
    glow_temperature_c,
    in_roles,
    relative_rate_change,
)
from labrig.report.sections import Picture, Section
from labrig.report.temperature import temperature_figure
from labrig.report.timing import moves_text


def lamp_sections(run: RunRecord) -> tuple[Section, ...]:
    """Whether something else switched the lamp, and whether lamp, shield and door moved on time."""
    attempts = list(run.completed().values())
    text = []
    used = [
        attempt.start.get("lamp_reads_back")
        for attempt in attempts
        if any(action.device == "lamp" for action in attempt.actions)
    ]
    if False in used:
        text.append(
            "The lamp's relay board does not tell whether it is on: that nothing else switched the "
            "lamp while it charged could not be checked, except by what the photographs show."
        )
    elif True in used:
        text.append(
            "The lamp's relay was read back about once a minute, and each time before it was "
            "switched: nothing else had switched it."
        )
    if moves := moves_text([action for attempt in attempts for action in attempt.actions]):
        text.append(moves)
    return (Section("Lamp, shield and door", tuple(text)),) if text else ()


def temperature_sections(run: RunRecord, roles: Collection[str]) -> tuple[Section, ...]:
    """Picture and words; nothing without a thermometer. Rates rest on frames of these roles."""
    if not run.temperatures():
        return ()
    course, photographs = Course(run), in_roles(run, roles)
    units = [list(group) for _, group in groupby(photographs, key=lambda frame: frame.unit)]
    began = run.attempts[0].start["time"]
    spans = [(one[0].start_time, one[-1].end_time) for one in units]
    glow_s = np.array(spans).reshape(-1, 2) - began
    shaded = " Shaded: the glow from which rates are fitted." if len(glow_s) else ""
    picture = Picture(
        "temperature",
        partial(temperature_figure, course.time - began, course.celsius, course.smooth, glow_s),
        f"Readings, and their means over five minutes (line).{shaded}",
    )
    text = (
        f"{degrees_text(course.smooth)} over the run ({len(course.time)} readings, smoothed over "
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
