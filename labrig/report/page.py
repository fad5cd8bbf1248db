"""The report: one HTML file that needs nothing else."""

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from labrig.errors import DiskError
from labrig.fit import DecayFit
from labrig.record.frames import FrameRecord
from labrig.report import parameters
from labrig.report.colours import Screen, screen_for
from labrig.report.content import PatchReport, RunReport
from labrig.report.decay_figures import linear_decay, logarithmic_decay, values_below_axis
from labrig.report.figure_style import figure_style, svg
from labrig.report.photographs import daylight_picture, glow_pictures
from labrig.report.residual_figure import residual_figure
from labrig.report.run_figures import overview_figures, timing_figure
from labrig.report.swatches import Swatch, swatches
from labrig.report.timing import FrameTiming, frame_timings
from labrig.report.written_numbers import rounded

TEMPLATE, STYLE = "report.html.j2", "report.css"
#: With more patches than this, photographs show their numbers and not their names.
NAMES_ON_PHOTOGRAPH = 3


@dataclass(frozen=True)
class _Figures:
    """SVG elements of one patch; residuals are empty without a fit."""

    linear: Markup
    logarithmic: Markup
    residuals: Markup
    below_axis: int


@dataclass(frozen=True)
class _Patch:
    """A patch as the template needs it."""

    number: int
    patch: PatchReport
    fit: DecayFit | None
    failure: str
    n_usable: int
    figures: _Figures
    swatches: tuple[Swatch, ...]
    #: Small figure for comparison; empty if there is only one patch.
    overview: Markup


@dataclass(frozen=True)
class _Timing:
    """Lateness of the frames in a sentence's numbers and a figure."""

    figure: Markup
    n_frames: int
    median_ms: str
    worst_ms: str
    worst_frame: str


def write_report(path: Path, report: RunReport) -> None:
    """Write `report` to `path`; the same report gives the same bytes.

    Raises
    ------
    DiskError
        `path` cannot be written.
    """
    text = _page(report)
    try:
        path.write_text(text, encoding="utf-8", newline="\n")
    except OSError as error:
        raise DiskError(f"{path}: cannot be written ({error.strerror})") from None


def _page(report: RunReport) -> str:
    folder = Path(__file__).parent
    environment = Environment(
        loader=FileSystemLoader(folder),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals.update(
        state_rows=parameters.state_rows,
        quality_rows=parameters.quality_rows,
        paper_rows=parameters.paper_rows,
        candidate_rows=parameters.candidate_rows,
        why_so_many_states=parameters.why_so_many_states,
        rounded=rounded,
        utc=_utc,
    )
    screen = screen_for(report.camera)
    with figure_style():
        patches = _patches(report, screen)
        timing = _timing(frame_timings(report.frames, report.patches))
    return environment.get_template(TEMPLATE).render(
        report=report,
        # The style sheet is labrig's own; escaping it would break its selectors.
        style=Markup((folder / STYLE).read_text(encoding="utf-8")),
        warnings=_warnings(report),
        patches=patches,
        timing=timing,
        daylight=daylight_picture(report.daylight, report.patches, screen),
        glow=glow_pictures(report.glow, screen),
        colours_known=screen.known,
        names_on_photograph=len(report.patches) <= NAMES_ON_PHOTOGRAPH,
    )


def _warnings(report: RunReport) -> list[str]:
    """Those of the report, and every missing fit that they do not mention."""
    missing = [(patch.name, patch.fit) for patch in report.patches if isinstance(patch.fit, str)]
    return [
        *report.warnings,
        *(
            f"{name}: no fit: {reason}"
            for name, reason in missing
            if not any(reason in warning for warning in report.warnings)
        ),
    ]


def _patches(report: RunReport, screen: Screen) -> list[_Patch]:
    small = [Markup("")] * len(report.patches)
    if len(report.patches) > 1:
        small = [
            Markup(svg(figure, f"overview-{number}", f"Decay of {patch.name}"))
            for number, (figure, patch) in enumerate(
                zip(overview_figures(report.patches), report.patches, strict=True), start=1
            )
        ]
    return [
        _Patch(
            number=number,
            patch=patch,
            fit=patch.fit if isinstance(patch.fit, DecayFit) else None,
            failure=patch.fit if isinstance(patch.fit, str) else "",
            n_usable=int(patch.series.usable.sum()),
            figures=_figures(number, patch),
            swatches=swatches(patch.series, screen),
            overview=overview,
        )
        for number, (patch, overview) in enumerate(zip(report.patches, small, strict=True), start=1)
    ]


def _figures(number: int, patch: PatchReport) -> _Figures:
    series = patch.series
    fit = patch.fit if isinstance(patch.fit, DecayFit) else None
    linear, logarithmic = linear_decay(series, fit), logarithmic_decay(series, fit)
    left = Markup("")
    if fit is not None:
        figure = residual_figure(series, fit)
        left = Markup(svg(figure, f"residuals-{number}", f"Residuals of the fit to {patch.name}"))
    return _Figures(
        linear=Markup(svg(linear, f"linear-{number}", f"{patch.name}, linear")),
        logarithmic=Markup(svg(logarithmic, f"log-{number}", f"{patch.name}, logarithmic")),
        residuals=left,
        below_axis=values_below_axis(series),
    )


def _timing(timings: tuple[FrameTiming, ...]) -> _Timing | None:
    if not timings:
        return None
    worst = max(timings, key=lambda timing: abs(timing.late_s))
    late_s = sorted(timing.late_s for timing in timings)
    return _Timing(
        figure=Markup(svg(timing_figure(timings), "timing", "Lateness of the frames")),
        n_frames=len(timings),
        median_ms=rounded(1e3 * late_s[len(late_s) // 2], 2),
        worst_ms=rounded(1e3 * worst.late_s, 2),
        worst_frame=worst.frame,
    )


def _utc(frame: FrameRecord) -> str:
    """When the frame began."""
    start = datetime.fromtimestamp(frame.start_time, UTC)
    return start.strftime("%Y-%m-%d %H:%M:%S.%f")[:-3]
