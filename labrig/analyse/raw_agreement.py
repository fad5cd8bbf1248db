"""The journal against the RAW files: exposure, ISO, f-number and times of the frames.

A camera writes into each RAW file what it was set to, and the time by its own clock. A journal that
says something else was edited, even if it was sealed again line by line.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from labrig.acquire import CAMERA, RigFile, load_driver, shutter_text
from labrig.analyse.overrides import Overrides
from labrig.foundation.errors import DataError, UsageError
from labrig.foundation.result_warning import Contradiction, ResultWarning
from labrig.optics import read_spectrometer_reading
from labrig.record import FrameRecord, RunRecord, SpectrumRecord
from labrig.reduce import Exif, frames_exif

#: Equal settings, with what a text of a number loses.
_SAME = 1e-6
#: Tolerance where the driver says nothing of its camera's times: what EXIF loses.
_SAME_UNDECLARED = 0.01
#: A bulb's time in EXIF is rounded to whole seconds, and the shutter has a lag.
_BULB_S = 1.0
#: Rounding of times since 1970, in seconds.
_ROUNDING_S = 1e-4
#: Scatter of the start of an exposure, and of the time that a camera notes for it, in seconds.
CLOCK_SCATTER_S = 0.25
#: Largest drift of a camera's clock against that of the PC: 4 s a day.
CLOCK_DRIFT = 5e-5
#: Labels of apertures are exact.
_SAME_F_NUMBER = 1e-3
#: Ways in which a camera of another driver may count: as labelled, or in steps of a stop.
_UNDECLARED_STEPS = (0, 3, 2)
#: Most frames that a message names.
_MAX_NAMED = 3

ExposuresOf = Callable[[float], tuple[float, ...]]


def settings_differences(
    run: RunRecord, rig: RigFile, frames: Sequence[FrameRecord]
) -> dict[FrameRecord, str]:
    """Return the frames whose journal differs from their RAW files, and how.

    Parameters
    ----------
    run
        Run of the frames.
    rig
        Rig file of the run, which names the camera's driver.
    frames
        Frames that are compared; one without EXIF is not.

    Returns
    -------
    dict of FrameRecord to str
        For each frame that differs what the journal and what the RAW file says.

    Examples
    --------
    >>> import labrig
    >>> from labrig.analyse import settings_differences
    >>> run = labrig.read_run("runs/decay")
    >>> settings_differences(run, labrig.read_rig_file("runs/decay/rig.yaml"), run.frames("decay"))
    {}
    """
    exif = frames_exif(frames)
    exposures = _driver_exposures(rig, run.camera_identity)
    exposure_texts = _exposure_differences(frames, exif, exposures)
    has_f_numbers = any(frame.f_number is not None for frame in frames)
    differences = {}
    for frame, raw, exposure_text in zip(frames, exif, exposure_texts, strict=True):
        texts = (
            exposure_text,
            _iso_difference(frame, raw),
            _f_number_difference(frame, raw, has_f_numbers),
        )
        if any(texts):
            differences[frame] = " and ".join(filter(None, texts))
    return differences


def spectra_differences(spectra: Sequence[SpectrumRecord]) -> dict[SpectrumRecord, str]:
    """Return the readings of a spectrometer whose journal differs from their files, and how.

    Parameters
    ----------
    spectra
        Readings that are compared; one that cannot be read is not.

    Returns
    -------
    dict of SpectrumRecord to str
        For each reading that differs what the journal and what the file says.

    Examples
    --------
    >>> from labrig.analyse import spectra_differences
    >>> spectra_differences([])
    {}
    """
    differences = {}
    for spectrum in spectra:
        try:
            reading = read_spectrometer_reading(spectrum.path)
        except (DataError, UsageError):
            continue
        repetitions = reading.raw_counts.shape[0]
        is_same_time = math.isclose(spectrum.integration_s, reading.integration_s, rel_tol=_SAME)
        if not is_same_time or repetitions != spectrum.repetitions:
            differences[spectrum] = (
                f"{spectrum.repetitions} × {spectrum.integration_s:.6g} s in the journal, "
                f"{repetitions} × {reading.integration_s:.6g} s in its file"
            )
    return differences


def clock_warnings(run: RunRecord) -> tuple[ResultWarning, ...]:
    """Return warnings about frames whose times differ from those of the camera's own clock.

    The two clocks are compared from one frame to the others, where they stand against each other
    does not matter. An interruption ends the comparison: either clock may be set before a run goes
    on. A camera may note the start or the end of an exposure.

    Parameters
    ----------
    run
        Run whose frames are compared; one without a time in its EXIF is not.

    Returns
    -------
    tuple of ResultWarning
        One warning with the largest excess and the first frames; empty if all agree.

    Examples
    --------
    >>> import labrig
    >>> from labrig.analyse import clock_warnings
    >>> clock_warnings(labrig.read_run("runs/decay"))
    ()
    """
    sessions = [_readings(frames) for frames in _sessions(run)]
    by_begin = [_jumps([(r.frame.start_time, r) for r in session]) for session in sessions]
    by_end = [_jumps([(r.frame.end_time, r) for r in session]) for session in sessions]
    jumps = min(by_begin, by_end, key=lambda each: sum(map(len, each)))
    off = [jump for session in jumps for jump in session]
    if not off:
        return ()
    names = ", ".join(reading.frame.path.name for _, reading in off[:_MAX_NAMED])
    more = f" and {len(off) - _MAX_NAMED} more" if len(off) > _MAX_NAMED else ""
    allowed_s = CLOCK_SCATTER_S + max(reading.step_s for _, reading in off)
    return (
        Contradiction(
            "camera-clock-differs",
            "the times of {frames} in the journal differ from those by the camera's own clock, "
            "against the frames before, by up to {most_s:.2f} s where {usual_s:.2f} s are usual: "
            "the camera's clock was set during the run, or the journal was edited",
            frames=f"{names}{more}",
            most_s=max(excess for excess, _ in off) + allowed_s,
            usual_s=allowed_s,
        ),
    )


@dataclass(frozen=True)
class _Reading:
    """A frame with its time by the camera's clock, and the step of that clock, in s."""

    frame: FrameRecord
    time_s: float
    step_s: float


def _sessions(run: RunRecord) -> Iterator[list[FrameRecord]]:
    """Yield the frames between two interruptions."""
    frames: list[FrameRecord] = []
    for attempt in run.attempts:
        frames += attempt.frames
        if not attempt.completed:
            yield frames
            frames = []
    yield frames


def _readings(frames: Sequence[FrameRecord]) -> list[_Reading]:
    return [
        _Reading(frame, raw.time_s, raw.time_step_s)
        for frame, raw in zip(frames, frames_exif(frames), strict=True)
        if raw.time_s is not None
    ]


def _jumps(readings: Sequence[tuple[float, _Reading]]) -> list[tuple[float, _Reading]]:
    """Return the frames at which one clock moved against the other, and by how much too much.

    The difference of the clocks may grow or fall by `CLOCK_DRIFT` from any earlier frame on, and
    scatter by `CLOCK_SCATTER_S` and the step of the camera's clock.
    """
    jumps = []
    highest = lowest = None
    for time_s, reading in readings:
        difference_s, drift_s = time_s - reading.time_s, CLOCK_DRIFT * time_s
        falling, rising = difference_s - drift_s, difference_s + drift_s
        if highest is None or lowest is None:
            highest, lowest = rising, falling
        excess_s = max(highest - rising, falling - lowest) - CLOCK_SCATTER_S - reading.step_s
        if excess_s > 0:
            jumps.append((excess_s, reading))
        else:
            highest, lowest = max(highest, rising), min(lowest, falling)
    return jumps


def _driver_exposures(rig: RigFile, identity: str) -> ExposuresOf | None:
    """Return the driver's table of exposure times; None if it has none, or is not installed."""
    if CAMERA.key not in rig.devices:
        return None
    try:
        driver = load_driver(CAMERA.key, rig.devices[CAMERA.key].driver, rig.name)
    except UsageError:
        return None
    table = getattr(driver, "recorded_exposures_s", None)
    return None if table is None else lambda label_s: tuple(table(label_s, identity))


def _exposure_differences(
    frames: Sequence[FrameRecord], exif: Sequence[Exif], exposures: ExposuresOf | None
) -> list[str]:
    """Return for each frame how its exposure differs; empty texts where it does not.

    A camera counts in one way throughout a run: that with the fewest differences is taken.
    """
    n_ways = len(_UNDECLARED_STEPS) if exposures is None else len(exposures(1.0))
    ways = [
        [
            _exposure_difference(frame, raw, exposures, way)
            for frame, raw in zip(frames, exif, strict=True)
        ]
        for way in range(n_ways)
    ]
    return min(ways, key=lambda texts: sum(map(bool, texts)))


def _exposure_difference(
    frame: FrameRecord, raw: Exif, exposures: ExposuresOf | None, way: int
) -> str:
    label_s, exposure_s = raw.exposure_s, frame.exposure_s
    if label_s is None:
        return ""
    if exposures is None:
        steps = _UNDECLARED_STEPS[way]
        actual_s = 2 ** (round(math.log2(label_s) * steps) / steps) if steps else label_s
        is_same = math.isclose(exposure_s, actual_s, rel_tol=_SAME_UNDECLARED)
    else:
        measured_s = frame.end_time - frame.start_time
        if abs(measured_s - exposure_s) > _ROUNDING_S:
            return (
                f"an exposure of {exposure_s:.6g} s in the journal, but {measured_s:.6g} s from "
                "its start to its end"
            )
        possible = exposures(label_s)
        is_same = (
            math.isclose(exposure_s, possible[way], rel_tol=_SAME)
            if possible
            else abs(exposure_s - label_s) <= _BULB_S
        )
    if is_same:
        return ""
    label = shutter_text(label_s)
    return f"an exposure of {exposure_s:.6g} s in the journal, {label} in the RAW file"


def _iso_difference(frame: FrameRecord, raw: Exif) -> str:
    if raw.iso is None or raw.iso == frame.iso:
        return ""
    return f"ISO {frame.iso} in the journal, ISO {raw.iso:g} in the RAW file"


def _f_number_difference(frame: FrameRecord, raw: Exif, has_f_numbers: bool) -> str:
    if raw.f_number is None or (frame.f_number is None and not has_f_numbers):
        return ""
    if frame.f_number is None:
        return f"no f-number in the journal, unlike others, f/{raw.f_number:g} in the RAW file"
    if math.isclose(frame.f_number, raw.f_number, rel_tol=_SAME_F_NUMBER):
        return ""
    return f"f/{frame.f_number:g} in the journal, f/{raw.f_number:g} in the RAW file"


def require_recorded_settings(run: RunRecord, rig: RigFile, overrides: Overrides) -> None:
    """Refuse a run whose journal differs from what its frames and spectra say of themselves.

    Parameters
    ----------
    run
        A recorded run.
    rig
        Rig file of the run, which names the camera's driver.
    overrides
        The user's settings, with the frames to leave out.

    Raises
    ------
    DataError
        A frame or a spectrum that is not excluded differs; the message names the first ones.

    Examples
    --------
    >>> import labrig
    >>> from labrig.analyse import Overrides, require_recorded_settings
    >>> rig = labrig.read_rig_file("runs/decay/rig.yaml")
    >>> require_recorded_settings(labrig.read_run("runs/decay"), rig, Overrides())
    """
    frames, spectra = [], []
    for attempt in run.completed().values():
        frames += [frame for frame in attempt.frames if not overrides.excludes(frame)]
        spectra += [spectrum for spectrum in attempt.spectra if not overrides.excludes(spectrum)]
    texts = [
        f"{file.path.name} has {text}"
        for differences in (settings_differences(run, rig, frames), spectra_differences(spectra))
        for file, text in differences.items()
    ]
    if texts:
        more = f" and {len(texts) - _MAX_NAMED} more differ" if len(texts) > _MAX_NAMED else ""
        raise DataError(
            f"{run.folder}: {', '.join(texts[:_MAX_NAMED])}{more}; the journal was changed after "
            "the run: restore it from a copy"
        )
