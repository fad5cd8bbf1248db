"""Report of a decay: results, sample, every patch, timing, and methods.

These are statements, with the sizes, and no warnings: the room may have been steady, and the sample
may have no such state.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from labrig.foundation.detection import DETECTION_SIGMA
from labrig.protocols.decay.report.figures import (
    law_figure,
    periodogram_figure,
    residual_figure,
    residual_periodogram,
    residuals,
)
from labrig.protocols.decay.result import DecayResult
from labrig.record import FrameRecord, FrameRole, RunDescription
from labrig.report.colours import Screen, Swatch, screen_for, swatches
from labrig.report.decay_figures import (
    linear_decay,
    logarithmic_decay,
    noise_figure,
    overview_figures,
    overview_tiles,
    timing_figure,
    values_below_axis,
    visible_parts,
)
from labrig.report.methods import REFERENCES, UNKNOWN, UNKNOWN_OF_A_TABLE, methods
from labrig.report.photographs import daylight_picture, glow_pictures, sensor_of
from labrig.report.report_model import (
    DECAY_ASSUMPTIONS,
    TABLE_ASSUMPTIONS,
    DecayReport,
    GlowPhotograph,
    PatchReport,
)
from labrig.report.sections import Picture, Rendered, Section, Source, own_template
from labrig.report.timing import (
    FrameTiming,
    LatenessStatistics,
    frame_lateness,
    frame_timings,
)
from labrig.results import DecayPatch, FittedDecay, ResultWithDecays, Series


def unrecorded_temperature(result: ResultWithDecays) -> tuple[str, ...]:
    """Return a sentence for each patch of which a drift of the temperature would matter."""
    return _of_patches(result, _temperature)


def outside_sections(result: ResultWithDecays) -> tuple[Section, ...]:
    """Return the section with all statements of a decay; empty if there are none."""
    unseen = _of_patches(result, lambda patch: patch.fit.outside_sigma if patch.fit else "")
    flicker = _of_patches(result, lambda patch: str((patch.fit and patch.fit.unseen_flicker) or ""))
    statements = (*unrecorded_temperature(result), *unseen, *flicker)
    if not statements:
        return ()
    text = tuple(f"{line[0].upper()}{line[1:]}." for line in statements)
    return (Section("Not in σ", text),)


def _of_patches(result: ResultWithDecays, sentence: Callable[[DecayPatch], str]) -> tuple[str, ...]:
    sentences = ((name, sentence(patch)) for name, patch in result.patches.items())
    return tuple(
        f"{name}: {text}" if len(result.patches) > 1 else text for name, text in sentences if text
    )


def _temperature(patch: DecayPatch) -> str:
    if patch.drift_effect is None or patch.fit is None:
        return ""
    changes = patch.fit.describe_changes(*patch.drift_effect.T.tolist())
    if not changes:
        return ""
    return (
        "the temperature was not recorded: 1 K in an hour, with traps 0.65 eV deep, would change "
        f"{changes}; a thermometer in the rig would show it"
    )


@dataclass(frozen=True)
class Repeat:
    """Brightness of a repeat relative to the first decay.

    Attributes
    ----------
    unit
        Name of the unit.
    ratio, sigma
        Ratio of the brightness and its standard uncertainty.
    """

    unit: str
    ratio: float
    sigma: float


def repeats(series: Series, fit: FittedDecay) -> tuple[Repeat, ...]:
    """Return the brightness of each unit but the first; units without usable frames are omitted.

    The factor of a unit to the common fit is 1 plus the mean common-mode deviation of its frames,
    weighted by the noise of a frame and its flicker.
    """
    deviations = residuals(series, fit)
    weight = 1 / (np.square(deviations.common_sigma) + fit.flicker**2)
    usable = series.usable & np.isfinite(deviations.common) & np.isfinite(weight)
    factors = []
    for unit in dict.fromkeys(series.unit):
        rows = usable & (np.array(series.unit) == unit)
        if rows.any():
            information = float(weight[rows].sum())
            mean = 1 + float(weight[rows] @ deviations.common[rows]) / information
            factors.append((unit, mean, 1 / np.sqrt(information)))
    if not factors:
        return ()
    (_, first, first_sigma), *others = factors
    return tuple(
        Repeat(
            unit, mean / first, mean / first * float(np.hypot(sigma / mean, first_sigma / first))
        )
        for unit, mean, sigma in others
    )


@dataclass(frozen=True)
class SteadySource:
    """Stability of a patch that shone steadily, such as a reference diode.

    Attributes
    ----------
    channel
        Name of the brightest channel.
    level, level_sigma
        Mean of its signal over all frames and the σ of the mean, in DN/s.
    drift, drift_sigma
        Change of a straight line through the signal from the first frame of a decay to the last,
        relative to the mean, and its σ.
    """

    channel: str
    level: float
    level_sigma: float
    drift: float
    drift_sigma: float


def steady(series: Series) -> SteadySource | None:
    """Return level and drift of a patch without a fit.

    σ follows from the scatter of the frames about a straight line and so includes flicker. The
    result is None if the patch is dark or has fewer than three usable frames.
    """
    values = series.values[series.usable]
    if len(values) < 3:
        return None
    brightest = int(values.mean(axis=0).argmax())
    value, t_s = values[:, brightest], series.t_s[series.usable]
    level, span_s = float(value.mean()), float(np.ptp(t_s))
    centred_s = t_s - t_s.mean()
    if not span_s:
        return None
    slope = float(centred_s @ value / (centred_s @ centred_s))
    residual = value - level - slope * centred_s
    scatter = float(np.sqrt(residual @ residual / (len(value) - 2)))
    level_sigma = scatter / np.sqrt(len(value))
    if not level > DETECTION_SIGMA * level_sigma:
        return None
    slope_sigma = scatter / np.sqrt(centred_s @ centred_s)
    return SteadySource(
        channel=series.channels[brightest],
        level=level,
        level_sigma=float(level_sigma),
        drift=slope * span_s / level,
        drift_sigma=float(slope_sigma * span_s / level),
    )


#: Largest number of patches that are shown in full; of more, the page shows an overview, and each
#: is folded up until a reader opens it.
MAX_UNFOLDED = 4
#: Largest number of patches whose names are shown on photographs; of more, numbers are shown.
NAMES_ON_PHOTOGRAPH = 3
#: Positions of the shown photographs of the glow, as fractions of the first decay's frames; dense
#: where the signal changes most.
GLOW_FRACTIONS = (0.0, 0.03, 0.09, 0.22, 0.5, 1.0)


@dataclass(frozen=True)
class _Patch:
    """Patch of the sample, as the templates need it.

    Attributes
    ----------
    number
        Number of the patch, counted from 1.
    anchor
        Target of links to the patch.
    patch
        Patch with its series.
    fit
        Fitted decay; None without one.
    failure
        Reason why there is no fit; empty with one.
    n_usable
        Number of usable frames.
    swatches
        Colours of the glow over time.
    repeats
        Brightness of the repeats relative to the first decay.
    steady
        Level and drift of a patch without a fit; None if it is dark.
    figures
        Figures of the patch.
    noise_parts
        Names of the parts of the noise that are drawn.
    below_axis
        Number of values below the logarithmic axis.
    """

    number: int
    anchor: str
    patch: PatchReport
    fit: FittedDecay | None
    failure: str
    n_usable: int
    swatches: tuple[Swatch, ...]
    repeats: tuple[Repeat, ...]
    steady: SteadySource | None
    figures: tuple[Picture, ...] = ()
    noise_parts: tuple[str, ...] = ()
    below_axis: int = 0


@dataclass(frozen=True)
class _Content:
    """Data for the templates of the sections of a decay.

    Attributes
    ----------
    report
        Decay as measured.
    patches
        All patches.
    colours_known
        Whether the camera's sensitivity is known.
    late
        Lateness of the frames; None without frames.
    patch
        Patch of a section about one patch; None in the others.
    extra
        Further data of single templates by name.
    """

    report: DecayReport
    patches: tuple[_Patch, ...]
    colours_known: bool
    late: LatenessStatistics | None = None
    patch: _Patch | None = None
    extra: Mapping[str, object] = field(default_factory=dict)

    @property
    def is_folded(self) -> bool:
        """Whether patches are folded up until a reader opens them."""
        return len(self.patches) > MAX_UNFOLDED


def render(result: DecayResult, source: Source) -> Rendered:
    """Render a decay: results, sample, patches, timing, and methods."""
    completed = source.run.completed().values()
    frames = [frame for attempt in completed for frame in attempt.frames]
    first = next(iter(result.patches.values())).series
    report = DecayReport(
        about=source.about,
        patches=tuple(_patch_report(name, patch) for name, patch in result.patches.items()),
        frames=tuple(frames),
        daylight=tuple(frame for frame in frames if frame.role == FrameRole.DAYLIGHT),
        glow=_glow(frames, first),
        camera=source.camera,
        charge_durations_s=result.charge_durations_s,
        background=result.background,
        states=result.states_requested,
    )
    lines = tuple(f"{name}\n{fit.table()}" for name, fit in result.fits.items())
    results, method_sections = decay_sections(report, source.anchor)
    unrecorded = unrecorded_temperature(result)
    sections = (*results, *outside_sections(result))
    return Rendered(sections, (*lines, *unrecorded), method_sections)


def decay_sections(
    report: DecayReport, anchor: str = ""
) -> tuple[tuple[Section, ...], tuple[Section, ...]]:
    """Return the sections with the results and those with the methods.

    Parameters
    ----------
    report
        Decay as measured and fitted.
    anchor
        Beginning of the names of all link targets.
    """
    screen = screen_for(report.camera)
    patches = tuple(
        _patch(number, patch, screen, anchor) for number, patch in enumerate(report.patches, 1)
    )
    timings = frame_timings(report.frames, report.patches)
    late = frame_lateness(timings)
    content = _Content(report, patches, screen.known, late)
    sensor = sensor_of([photograph.frame for photograph in report.glow])
    overview = [_results(content, anchor)]
    if report.frames:
        overview.append(_sample(content, screen, anchor))
    results = (
        # A long table would hide the photograph that says where the patches are.
        *(reversed(overview) if content.is_folded else overview),
        *(
            Section(
                f"Patch {patch.patch.name}",
                figures=patch.figures,
                anchor=patch.anchor,
                template=own_template(__file__, "patch"),
                content=_Content(report, patches, screen.known, late, patch),
            )
            for patch in patches
        ),
        *_timing(content, timings, anchor),
    )
    methods_section = Section(
        "Methods",
        anchor=f"{anchor}methods",
        template=own_template(__file__, "methods"),
        content={
            "methods": methods(report, sensor, late),
            "references": REFERENCES,
            "unknown": UNKNOWN if report.frames else UNKNOWN_OF_A_TABLE,
        },
    )
    assumptions = DECAY_ASSUMPTIONS if report.frames else TABLE_ASSUMPTIONS
    return results, (methods_section, Section("Assumptions", points=assumptions))


def table_sections(
    result: DecayResult, about: RunDescription
) -> tuple[tuple[Section, ...], tuple[Section, ...]]:
    """Return the sections of a decay from another program's table, with results and with methods.

    Parameters
    ----------
    result
        Fitted decay of each region of the table.
    about
        Description of the table.

    Returns
    -------
    results : tuple of Section
        Sections with results.
    methods : tuple of Section
        Sections with methods.

    Examples
    --------
    >>> import labrig
    >>> from labrig.record import RunDescription
    >>> from labrig.protocols.decay.report import table_sections
    >>> about = RunDescription(
    ...     title="series.csv", protocol="decay", run="series.csv", started="", ended="", rig="",
    ...     simulated=False, labrig_version="0.1.0"
    ... )
    >>> results, methods = table_sections(labrig.read_result("runs/decay"), about)
    >>> [section.title for section in results]
    ['Results', 'Patch sample', 'Not in σ']
    """
    patches = tuple(_patch_report(name, patch) for name, patch in result.patches.items())
    results, method_sections = decay_sections(
        DecayReport(about, patches, states=result.states_requested)
    )
    return (*results, *outside_sections(result)), method_sections


def _patch_report(name: str, patch: DecayPatch) -> PatchReport:
    """Return a patch of the result as a patch of the report."""
    return PatchReport(name, patch.region, patch.series, patch.fit or patch.failure, patch.noise)


def _glow(frames: Sequence[FrameRecord], series: Series) -> tuple[GlowPhotograph, ...]:
    """Return some photographs of the first decay, by rising time."""
    by_name = {frame.path.name: frame for frame in frames}
    first = series.by_unit()[0]
    last = len(first.frame) - 1
    chosen = sorted({round(fraction * last) for fraction in GLOW_FRACTIONS})
    return tuple(GlowPhotograph(by_name[first.frame[row]], float(first.t_s[row])) for row in chosen)


def _results(content: _Content, anchor: str) -> Section:
    """Return the section with the table of all patches, and a small figure each if several."""
    figures: tuple[Picture, ...] = ()
    if content.is_folded:
        tiles, axes = overview_tiles(content.report.patches)
        content = replace(content, extra={"tiles": tiles, "axes": axes})
    elif len(content.patches) > 1:
        figures = tuple(
            Picture(f"overview-{patch.number}-{patch.patch.name}", chart)
            for patch, chart in zip(
                content.patches, overview_figures(content.report.patches), strict=True
            )
        )
    return Section(
        "Results",
        figures=figures,
        anchor=f"{anchor}results",
        template=own_template(__file__, "results"),
        content=content,
    )


def _sample(content: _Content, screen: Screen, anchor: str) -> Section:
    """Return the section with the photographs and properties of the sample."""
    report = content.report
    extra = {
        "daylight": daylight_picture(report.daylight, report.patches, screen),
        "glow": glow_pictures(report.glow, screen),
        "names_on_photograph": len(report.patches) <= NAMES_ON_PHOTOGRAPH,
        "timing": f"{anchor}timing",
    }
    return Section(
        "Sample",
        anchor=f"{anchor}sample",
        template=own_template(__file__, "sample"),
        content=_Content(report, content.patches, screen.known, content.late, extra=extra),
    )


def _timing(content: _Content, timings: Sequence[FrameTiming], anchor: str) -> tuple[Section, ...]:
    """Return the section on lateness, repeats and steady patches, or none without any of them."""
    repeat_units = list(
        dict.fromkeys(repeat.unit for patch in content.patches for repeat in patch.repeats)
    )
    steady_patches = [patch for patch in content.patches if patch.steady]
    if not (content.late or repeat_units or steady_patches):
        return ()
    figures = (Picture("timing", timing_figure(timings)),) if timings else ()
    return (
        Section(
            "Timing and stability",
            figures=figures,
            anchor=f"{anchor}timing",
            template=own_template(__file__, "timing"),
            content=_Content(
                content.report,
                content.patches,
                content.colours_known,
                content.late,
                extra={"repeat_units": repeat_units, "steady_patches": steady_patches},
            ),
        ),
    )


def _patch(number: int, patch: PatchReport, screen: Screen, anchor: str) -> _Patch:
    """Return a patch with its figures, swatches, repeats and drift."""
    fit = patch.fit if isinstance(patch.fit, FittedDecay) else None
    series = patch.series
    figures = [
        Picture("linear", linear_decay(series, fit)),
        Picture("logarithmic", logarithmic_decay(series, fit)),
    ]
    noise_parts: tuple[str, ...] = ()
    if fit is not None:
        figures.append(Picture("residuals", residual_figure(series, fit)))
        if (lines := residual_periodogram(series, fit)) is not None:
            figures.append(Picture("periodogram", periodogram_figure(lines)))
        figures.append(Picture("laws", law_figure(series, fit)))
    if patch.noise is not None:
        figures.append(Picture("noise", noise_figure(patch.noise)))
        noise_parts = tuple(visible_parts(patch.noise))
    return _Patch(
        number=number,
        anchor=f"{anchor}patch-{number}",
        patch=patch,
        fit=fit,
        failure=patch.fit if isinstance(patch.fit, str) else "",
        n_usable=int(series.usable.sum()),
        swatches=swatches(series, screen),
        repeats=repeats(series, fit) if fit else (),
        steady=None if fit else steady(series),
        figures=tuple(figures),
        noise_parts=noise_parts,
        below_axis=values_below_axis(series),
    )
