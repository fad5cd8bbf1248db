"""Methods section of a paper on a run, with statements that hold for this run only."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from labrig.foundation.errors import UsageError
from labrig.foundation.number_format import exposure_text, rounded
from labrig.foundation.quantity import duration_text
from labrig.foundation.region import region_pixels
from labrig.record import FrameRecord, FrameRole
from labrig.report.photographs import Sensor
from labrig.report.report_model import DecayReport
from labrig.report.timing import ON_TIME_S, LatenessStatistics
from labrig.results import EXPONENTIALS, LAW_LABELS, LAW_NAMES, FittedDecay

#: Relative difference below which durations and exposures are given as one value.
ALIKE = 0.02
#: Relative spread of the pauses between frames from which they are random.
RANDOM = 0.1


def recording(
    report: DecayReport, sensor: Sensor | None, late: LatenessStatistics | None
) -> Iterator[str]:
    """Yield the sentences on the measurement, from the charge to the values."""
    if not report.frames:
        yield from _table(report)
        return
    how = "simulated" if report.about.simulated else "measured"
    yield f"The decay of the phosphorescence of {report.about.title} was {how} with labrig."
    decays = [frame for frame in report.frames if frame.role == FrameRole.DECAY]
    if decays:
        yield from _charge(report, decays)
        yield from _frames(report, sensor, decays)
    if late is not None:
        yield _punctuality(late)
    yield _mean(report, sensor)
    yield from _dark(report)
    yield from _exclusions(report)


def _table(report: DecayReport) -> Iterator[str]:
    """Yield the sentences on a decay that was read from another program's table."""
    counts = [len(patch.series.t_s) for patch in report.patches]
    t_s = np.concatenate([patch.series.t_s for patch in report.patches])
    yield (
        f"The decay was read from the table {report.about.run}: {sum(counts)} values from "
        f"{rounded(float(t_s.min()), 3)} s to {rounded(float(t_s.max()), 3)} s after "
        f"{_zero(report)}."
    )


def _zero(report: DecayReport) -> str:
    """Return the time from which the times of a decay count, in words."""
    fits = (patch.fit for patch in report.patches)
    references = (str(fit.reference) for fit in fits if isinstance(fit, FittedDecay))
    return next(references, "lamp off")


def _charge(report: DecayReport, decays: Sequence[FrameRecord]) -> Iterator[str]:
    """Yield the sentence on the charge."""
    if not report.charge_durations_s:
        return
    repeats = len({frame.unit for frame in decays})
    sample = "samples were" if len(report.patches) > 1 else "sample was"
    before = f"Before each of {repeats} decays the {sample}" if repeats > 1 else f"The {sample}"
    yield f"{before} charged under the lamp for {_range(report.charge_durations_s, duration_text)}."


def _frames(
    report: DecayReport, sensor: Sensor | None, decays: Sequence[FrameRecord]
) -> Iterator[str]:
    """Yield the sentence on the camera, its settings and its exposures."""
    name = sensor.camera if sensor and sensor.camera else "camera"
    camera = f"{'an' if name[0] in 'AEIOU' else 'a'} {name}"
    units = list(dict.fromkeys(frame.unit for frame in decays))
    counts = [sum(frame.unit == unit for frame in decays) for unit in units]
    count = " to ".join(str(number) for number in dict.fromkeys((min(counts), max(counts))))
    series = report.patches[0].series
    yield (
        f"After the lamp had been switched off, {camera} at {', '.join(_settings(decays))} took "
        f"{count} RAW frames{' a decay' if len(units) > 1 else ''}, each exposed for "
        f"{_exposures(decays)}{_interval(decays)}, from {rounded(float(series.t_s.min()), 3)} s to "
        f"{rounded(float(series.t_s.max()), 3)} s after lamp off."
    )


def _punctuality(late: LatenessStatistics) -> str:
    """Return the sentence on the lateness of the exposures."""
    if abs(late.worst_s) < ON_TIME_S:
        return f"Every exposure began within {_ms(ON_TIME_S)} of its planned time."
    return (
        f"Exposures began {_ms(late.median_s)} later than planned in the median and "
        f"{_ms(late.worst_s)} at worst; the measured times were used."
    )


def _settings(frames: Sequence[FrameRecord]) -> list[str]:
    """Return the f-numbers and ISO speeds of the frames as text."""
    apertures = sorted({frame.f_number for frame in frames if frame.f_number is not None})
    speeds = sorted({frame.iso for frame in frames})
    return [
        *(f"f/{rounded(setting, 3)}" for setting in apertures),
        *(f"ISO {setting}" for setting in speeds),
    ]


def _exposures(frames: Sequence[FrameRecord]) -> str:
    """Return the range of the exposure times as text."""
    return _range([frame.exposure_s for frame in frames], exposure_text)


def _interval(decays: Sequence[FrameRecord]) -> str:
    """Return the planned interval between exposures as text: the measured one less lateness.

    Of random begins it is the mean, and the shortest one.
    """
    gaps_s = [
        (after.start_time - after.late_s) - (before.start_time - before.late_s)
        for before, after in pairwise(decays)
        if before.unit == after.unit
    ]
    if not gaps_s:
        return ""
    mean_s, least_s = float(np.mean(gaps_s)), min(gaps_s)
    if max(gaps_s) - least_s > RANDOM * mean_s:
        return (
            f", at random times, one every {duration_text(mean_s)} in the mean and at least "
            f"{duration_text(float(rounded(least_s, 3)))} apart"
        )
    return f", one every {duration_text(float(np.median(gaps_s)))}"


def _mean(report: DecayReport, sensor: Sensor | None) -> str:
    """Return the sentence on the mean over a region."""
    channels = report.patches[0].series.channels
    place = "regions" if len(report.patches) > 1 else "a region"
    size = _sizes(report, sensor)
    per_channel = f", for each of the channels {listed(channels)}" if len(channels) > 1 else ""
    return (
        "The linear RAW values above the black level, neither demosaiced nor white balanced, were "
        f"averaged over {place} of the frame{f' of {size}' if size else ''}{per_channel} "
        "and divided by the exposure time."
    )


def _sizes(report: DecayReport, sensor: Sensor | None) -> str:
    """Return the sizes of the regions in pixels as text; empty if they are not known."""
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
    """Yield the sentence on the level that was subtracted."""
    darks = [frame for frame in report.frames if frame.role == FrameRole.DARK]
    decays = [frame for frame in report.frames if frame.role == FrameRole.DECAY]
    if report.background is not None:
        yield "The level of a dark region of the same frame was subtracted from each."
    elif darks and decays:
        first_decay = min(frame.start_time for frame in decays)
        before = (
            ", taken before the decay"
            if max(dark.start_time for dark in darks) < first_decay
            else ""
        )
        yield (
            f"The dark level ({len(darks)} dark frames of {_exposures(darks)}{before}) was "
            "subtracted."
        )


def _exclusions(report: DecayReport) -> Iterator[str]:
    """Yield the sentence on excluded frames."""
    items = "frames" if len(report.patches) == 1 else "values of all patches"
    flags = [flag for patch in report.patches for flag in patch.series.flag]
    n_excluded = len(flags) - sum(int(patch.series.usable.sum()) for patch in report.patches)
    n_clipped = sum("clipped" in flag for flag in flags)
    if n_excluded:
        fraction = "" if n_clipped == n_excluded else f", {n_clipped} of them"
        reason = f"{fraction} because pixels were saturated" if n_clipped else ""
        yield f"{n_excluded} of {len(flags)} {items} were left out{reason}."


def listed(words: Sequence[str]) -> str:
    """Return words as a list in text, such as `R, G and B`."""
    return " and ".join(filter(None, (", ".join(words[:-1]), words[-1])))


def _range(numbers: Sequence[float], format_number: Callable[[float], str]) -> str:
    """Return the range of numbers as text, or their median if they are nearly equal."""
    low, high = min(numbers), max(numbers)
    if high <= low * (1 + ALIKE):
        return format_number(float(np.median(numbers)))
    return f"{format_number(low)} to {format_number(high)}"


def _ms(seconds: float) -> str:
    """Return a time in ms as text."""
    return f"{rounded(1e3 * seconds, 2)} ms"


EQUATION_LATEX = (
    r"s_c(t, T) = w_c \sum_{i=1}^{n} a_i \, e^{-k_i t} \, \frac{1 - e^{-k_i T}}{k_i T} + b_c"
)
REFERENCES = (
    "O. Nalbach, H.-P. Seidel, T. Ritschel: Practical Capture and Reproduction of Phosphorescent "
    "Appearance. Computer Graphics Forum 36(2), 409–420, 2017. doi:10.1111/cgf.13136",
    "C. R. Harris et al.: Array programming with NumPy. Nature 585, 357–362, 2020. "
    "doi:10.1038/s41586-020-2649-2",
    "P. Virtanen et al.: SciPy 1.0: fundamental algorithms for scientific computing in Python. "
    "Nature Methods 17, 261–272, 2020. doi:10.1038/s41592-019-0686-2",
)
#: Properties that a paper should state and that labrig cannot know.
UNKNOWN = (
    "the lamp's type, power and distance",
    "the lens and the camera's distance",
    "the sample's temperature",
)
#: The same of a decay in another program's table.
UNKNOWN_OF_A_TABLE = (
    "the instrument and its settings",
    "how the sample was charged",
    "the sample's temperature",
)
#: Names of the libraries in papers, with their references.
_SOFTWARE = {"numpy": "NumPy {} [2]", "scipy": "SciPy {} [3]", "libraw": "LibRaw {}"}


@dataclass(frozen=True)
class Methods:
    """Paragraphs of a methods section in plain text.

    Attributes
    ----------
    recording
        Paragraph on the measurement.
    model
        Paragraph on the decay model, which the equation follows; empty without a fit.
    analysis
        Paragraph on the fit and the software.
    """

    recording: str
    model: str
    analysis: str

    @property
    def plain(self) -> str:
        """All paragraphs and references as plain text, with the equation in LaTeX."""
        references = [f"[{number}] {text}" for number, text in enumerate(REFERENCES, start=1)]
        equation = f"\\begin{{equation}}\n  {EQUATION_LATEX}\n\\end{{equation}}"
        fitted = [self.model, equation] if self.model else []
        return "\n\n".join([self.recording, *fitted, self.analysis, "\n".join(references)])


def methods(report: DecayReport, sensor: Sensor | None, late: LatenessStatistics | None) -> Methods:
    """Return the methods section of a run.

    Parameters
    ----------
    report
        Decay as measured and fitted.
    sensor
        Camera that took the frames; None if it is not known.
    late
        Lateness of the frames; None if it is not known.
    """
    fits = [patch.fit for patch in report.patches if isinstance(patch.fit, FittedDecay)]
    software = list(_software(report))
    return Methods(
        recording=" ".join(recording(report, sensor, late)),
        model=_model(report) if fits else "",
        analysis=" ".join([*(_analysis(report, fits) if fits else ()), *software]),
    )


def _model(report: DecayReport) -> str:
    """Return the sentence on the decay model."""
    channel = "" if len(report.patches[0].series.channels) == 1 else " in channel c"
    zero = _zero(report)
    if not any(patch.series.exposure_s.any() for patch in report.patches):
        return (
            f"The signal{channel} at the time t after {zero} was modelled, after Nalbach et al. "
            "[1], as a sum of n exponential decays of momentary values, T → 0:"
        )
    return (
        f"The signal{channel} of an exposure from t to t + T after {zero} was modelled, after "
        "Nalbach et al. [1], as a sum of n exponential decays, each averaged over the exposure:"
    )


def _analysis(report: DecayReport, fits: list[FittedDecay]) -> Iterator[str]:
    """Yield the sentences on the fit."""
    offset = (
        f"an offset b_c{', constrained by the uncertainty of the dark level' * bool(report.frames)}"
        if any(any(fit.offsets_sigma) for fit in fits)
        else "no offset, b_c = 0"
    )
    if len(fits[0].channels) > 1:
        yield (
            "The rates k_i and the amplitudes a_i are common to all channels; each channel has a "
            f"weight w_c, which is 1 for the brightest, and {offset}."
        )
    else:
        yield f"Here k_i are the rates and a_i the amplitudes; there are w_c = 1 and {offset}."
    yield "All parameters were fitted together by weighted nonlinear least squares."
    scatter = next((fit.scatter for fit in fits if fit.scatter), None)
    noise = "the photon and read noise found in the frames"
    if scatter is not None:
        noise = f"the standard uncertainty of the values, taken {scatter}"
    elif not report.frames:
        origins = dict.fromkeys(fit.sigma_origin or "the table" for fit in fits)
        noise = f"the standard uncertainties of {'; '.join(origins)}"
    yield f"The weights follow {noise}{_flicker(fits)}."
    states = [str(number) for number in sorted({fit.n_states for fit in fits})]
    number = f"n = {states[0]}" if len(states) == 1 else f"n = {' or '.join(states)} by patch"
    if report.states is not None and states == [str(report.states)]:
        yield f"The number of states was set to {report.states}."
    elif report.states is not None:
        yield (
            f"The number of states was set to {report.states}, of which the data support {number}."
        )
    else:
        yield (
            f"The number of states, {number}, was chosen by the Bayesian information criterion "
            "and an F-test."
        )
    others = [LAW_LABELS[name] for name in LAW_NAMES if name != EXPONENTIALS]
    yield (
        f"Other laws were fitted to the same data: {listed(others)}; another law than exponentials "
        "is taken if its BIC is lower by 1, by 6 if it contains them."
    )
    yield "Uncertainties are standard uncertainties (1 σ) from the covariance of the fit."


def _flicker(fits: list[FittedDecay]) -> str:
    """Return the statement on flicker, which patches share; the value of smallest σ is given."""
    measured = [fit for fit in fits if fit.flicker_sigma > 0]
    best = min(measured, key=lambda fit: fit.flicker_sigma, default=fits[0])
    if best.flicker == 0:
        return ""
    source = "as their scatter about the decay shows" if measured else "an assumption"
    percent = rounded(100 * best.flicker, 2)
    return f" and a flicker of {percent} % that the channels of a frame share, {source}"


def _software(report: DecayReport) -> Iterator[str]:
    """Yield the sentence on the software and its versions."""
    versions = dict(report.about.libraries)
    libraries = [
        text.format(versions[name])
        for name, text in _SOFTWARE.items()
        # LibRaw reads frames, which a table has not.
        if name in versions and (report.frames or name != "libraw")
    ]
    with_libraries = f" with {listed(libraries)}" if libraries else ""
    version = report.about.labrig_version
    done = "Recording and analysis were" if report.frames else "The analysis was"
    yield f"{done} done by labrig {version}{with_libraries}."
