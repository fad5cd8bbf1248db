"""How the frames of a run were taken and reduced, in sentences."""

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise

import numpy as np

from labrig.errors import UsageError
from labrig.quantity import duration_text
from labrig.record import FrameRecord, FrameRole
from labrig.region import region_pixels
from labrig.report.content import DecayReport
from labrig.report.photographs import Sensor
from labrig.report.timing import ON_TIME_S, Lateness
from labrig.written_numbers import exposure_text, rounded

#: Durations and exposures that differ by less are said as one.
ALIKE = 0.02


def recording(report: DecayReport, sensor: Sensor | None, late: Lateness | None) -> Iterator[str]:
    """From the charge to the values, a sentence each."""
    how = "simulated" if report.about.simulated else "measured"
    yield f"The decay of the phosphorescence of {report.about.title} was {how} with labrig."
    decays = [frame for frame in report.frames if frame.purpose == FrameRole.DECAY]
    if decays:
        yield from _charge(report, decays)
        yield from _frames(report, sensor, decays)
    if late is not None:
        yield _punctuality(late)
    yield _mean(report, sensor)
    yield from _dark(report)
    yield from _left_out(report)


def _charge(report: DecayReport, decays: Sequence[FrameRecord]) -> Iterator[str]:
    if not report.charges_s:
        return
    repeats = len({frame.unit for frame in decays})
    sample = "samples were" if len(report.patches) > 1 else "sample was"
    before = f"Before each of {repeats} decays the {sample}" if repeats > 1 else f"The {sample}"
    yield f"{before} charged under the lamp for {_range(report.charges_s, duration_text)}."


def _frames(
    report: DecayReport, sensor: Sensor | None, decays: Sequence[FrameRecord]
) -> Iterator[str]:
    name = sensor.camera if sensor and sensor.camera else "camera"
    camera = f"{'an' if name[0] in 'AEIOU' else 'a'} {name}"
    units = list(dict.fromkeys(frame.unit for frame in decays))
    counts = [sum(frame.unit == unit for frame in decays) for unit in units]
    count = " to ".join(str(one) for one in dict.fromkeys((min(counts), max(counts))))
    series = report.patches[0].series
    yield (
        f"After the lamp had been switched off, {camera} at {', '.join(_settings(decays))} took "
        f"{count} RAW frames{' a decay' if len(units) > 1 else ''}, each exposed for "
        f"{_exposures(decays)}{_interval(decays)}, from {rounded(float(series.t_s.min()), 3)} s to "
        f"{rounded(float(series.t_s.max()), 3)} s after lamp off."
    )


def _punctuality(late: Lateness) -> str:
    if abs(late.worst_s) < ON_TIME_S:
        return f"Every exposure began within {_ms(ON_TIME_S)} of its planned time."
    return (
        f"Exposures began {_ms(late.median_s)} later than planned in the median and "
        f"{_ms(late.worst_s)} at worst; the measured times were used."
    )


def _settings(frames: Sequence[FrameRecord]) -> list[str]:
    apertures = sorted({frame.f_number for frame in frames if frame.f_number is not None})
    speeds = sorted({frame.iso for frame in frames})
    return [*(f"f/{rounded(one, 3)}" for one in apertures), *(f"ISO {one}" for one in speeds)]


def _exposures(frames: Sequence[FrameRecord]) -> str:
    return _range([frame.exposure_s for frame in frames], exposure_text)


def _interval(decays: Sequence[FrameRecord]) -> str:
    """From begin to begin as planned: as measured, less the lateness."""
    gaps_s = [
        (after.start_time - after.late_s) - (before.start_time - before.late_s)
        for before, after in pairwise(decays)
        if before.unit == after.unit
    ]
    return f", one every {duration_text(float(np.median(gaps_s)))}" if gaps_s else ""


def _mean(report: DecayReport, sensor: Sensor | None) -> str:
    channels = report.patches[0].series.channels
    place = "regions" if len(report.patches) > 1 else "a region"
    size = _sizes(report, sensor)
    each = f", for each of the channels {listed(channels)}" if len(channels) > 1 else ""
    return (
        "The linear RAW values above the black level, neither demosaiced nor white balanced, were "
        f"averaged over {place} of the frame{f' of {size}' if size else ''}{each} and divided by "
        "the exposure time."
    )


def _sizes(report: DecayReport, sensor: Sensor | None) -> str:
    sizes = set()
    for patch in report.patches:
        if sensor is None or patch.region is None:
            return ""
        try:
            _, _, width, height = region_pixels(patch.region, sensor.width, sensor.height)
        except UsageError:
            return ""
        sizes.add((width * height, f"{width} × {height}"))
    texts = [text for _, text in sorted(sizes)]
    return " to ".join(dict.fromkeys((texts[0], texts[-1]))) + " pixels"


def _dark(report: DecayReport) -> Iterator[str]:
    darks = [frame for frame in report.frames if frame.purpose == FrameRole.DARK]
    decays = [frame for frame in report.frames if frame.purpose == FrameRole.DECAY]
    if report.background is not None:
        yield "The level of a dark region of the same frame was subtracted from each."
    elif darks and decays:
        began = min(frame.start_time for frame in decays)
        before = ", taken before the decay" if max(d.start_time for d in darks) < began else ""
        yield (
            f"The dark level ({len(darks)} dark frames of {_exposures(darks)}{before}) was "
            "subtracted."
        )


def _left_out(report: DecayReport) -> Iterator[str]:
    all_of = "frames" if len(report.patches) == 1 else "values of all patches"
    flags = [flag for patch in report.patches for flag in patch.series.flag]
    out = len(flags) - sum(int(patch.series.usable.sum()) for patch in report.patches)
    clipped = sum("clipped" in flag for flag in flags)
    if out:
        share = "" if clipped == out else f", {clipped} of them"
        why = f"{share} because pixels were saturated" if clipped else ""
        yield f"{out} of {len(flags)} {all_of} were left out{why}."


def listed(words: Sequence[str]) -> str:
    """`R, G and B`."""
    return " and ".join(filter(None, (", ".join(words[:-1]), words[-1])))


def _range(numbers: Sequence[float], written: Callable[[float], str]) -> str:
    low, high = min(numbers), max(numbers)
    if high <= low * (1 + ALIKE):
        return written(float(np.median(numbers)))
    return f"{written(low)} to {written(high)}"


def _ms(seconds: float) -> str:
    return f"{rounded(1e3 * seconds, 2)} ms"
