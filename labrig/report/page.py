"""The report: one HTML file that needs nothing else."""

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from markupsafe import Markup

from labrig.errors import DiskError
from labrig.fit import DecayFit
from labrig.report import parameters
from labrig.report.colours import Screen, screen_for
from labrig.report.content import PatchReport, RunReport
from labrig.report.decay_figures import linear_decay, logarithmic_decay, values_below_axis
from labrig.report.figure_style import figure_style
from labrig.report.methods import REFERENCES, UNKNOWN, methods
from labrig.report.noise_budget import noise_budget
from labrig.report.noise_figure import noise_figure
from labrig.report.photographs import daylight_picture, glow_pictures, sensor_of
from labrig.report.plates import Plate, Plates
from labrig.report.residual_figure import residual_figure
from labrig.report.run_figures import overview_figures, timing_figure
from labrig.report.shown import Shown, draw
from labrig.report.stability import Repeat, Steady, repeats, steady
from labrig.report.swatches import Swatch, swatches
from labrig.report.template import dated_notes, environment, script, style
from labrig.report.timing import Lateness, frame_timings, lateness, moves_text

TEMPLATE = "report.html.j2"
#: With more patches than this, photographs show their numbers and not their names.
NAMES_ON_PHOTOGRAPH = 3


@dataclass(frozen=True)
class _Figures:
    """Of one patch: residuals only with a fit, noise only where σ is known; its parts by name."""

    linear: Plate
    logarithmic: Plate
    residuals: Plate | None
    noise: Plate | None
    noise_parts: tuple[str, ...]
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
    repeats: tuple[Repeat, ...]
    #: Without a fit, if it shone.
    steady: Steady | None
    #: Small figure for comparison; None if there is only one patch.
    overview: Plate | None


def write_report(path: Path, report: RunReport) -> None:
    """Write `report` to `path`, and its figures for print into a folder `figures` beside it.

    The same report gives the same bytes.

    Raises
    ------
    DiskError
        `path` cannot be written.
    """
    screen = screen_for(report.camera)
    with figure_style(), Plates(f"{report.title}, {report.run}") as plates:
        patches = _patches(report, screen, plates)
        timings = frame_timings(report.frames, report.patches)
        timing = None
        if timings:
            timing = plates.add(timing_figure(timings), "timing", "Lateness of the frames")
        shown = draw(report.sections, plates)
    text = _page(report, screen, patches, lateness(timings), timing, shown)
    try:
        path.write_text(text, encoding="utf-8", newline="\n")
        plates.write(path.parent)
    except OSError as error:
        raise DiskError(f"{path}: cannot be written ({error.strerror})") from None


def _page(
    report: RunReport,
    screen: Screen,
    patches: Sequence[_Patch],
    late: Lateness | None,
    timing: Plate | None,
    shown: Sequence[Shown],
) -> str:
    templates = environment()
    templates.globals.update(
        state_rows=parameters.state_rows,
        quality_rows=parameters.quality_rows,
        paper_rows=parameters.paper_rows,
        candidate_rows=parameters.candidate_rows,
        why_so_many_states=parameters.why_so_many_states,
    )
    templates.filters["quoted"] = shlex.quote
    photographed = [photograph.frame for photograph in report.glow]
    return templates.get_template(TEMPLATE).render(
        report=report,
        # Style sheet and script are labrig's own; escaping them would break them.
        style=Markup(style()),
        script=Markup(script()),
        warnings=_warnings(report),
        notes=dated_notes(report.notes),
        patches=patches,
        late=late,
        moves=moves_text(report.actions),
        timing=timing,
        shown=shown,
        repeated=list(dict.fromkeys(one.unit for item in patches for one in item.repeats)),
        methods=methods(report, sensor_of(photographed), late),
        references=REFERENCES,
        unknown=UNKNOWN,
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


def _patches(report: RunReport, screen: Screen, plates: Plates) -> list[_Patch]:
    small: list[Plate | None] = [None] * len(report.patches)
    if len(report.patches) > 1:
        small = [
            plates.add(figure, f"overview-{number}-{patch.name}", f"Decay of {patch.name}")
            for number, (figure, patch) in enumerate(
                zip(overview_figures(report.patches), report.patches, strict=True), start=1
            )
        ]
    return [
        _patch(number, patch, screen, plates, overview)
        for number, (patch, overview) in enumerate(zip(report.patches, small, strict=True), start=1)
    ]


def _patch(
    number: int, patch: PatchReport, screen: Screen, plates: Plates, overview: Plate | None
) -> _Patch:
    fit = patch.fit if isinstance(patch.fit, DecayFit) else None
    return _Patch(
        number=number,
        patch=patch,
        fit=fit,
        failure=patch.fit if isinstance(patch.fit, str) else "",
        n_usable=int(patch.series.usable.sum()),
        figures=_figures(f"{number}-{patch.name}", patch, fit, plates),
        swatches=swatches(patch.series, screen),
        repeats=repeats(patch.series, fit) if fit else (),
        steady=None if fit else steady(patch.series),
        overview=overview,
    )


def _figures(which: str, patch: PatchReport, fit: DecayFit | None, plates: Plates) -> _Figures:
    series, name = patch.series, patch.name
    linear = plates.add(linear_decay(series, fit), f"linear-{which}", f"{name}, linear")
    logarithmic = plates.add(
        logarithmic_decay(series, fit), f"logarithmic-{which}", f"{name}, logarithmic"
    )
    left = noise = budget = None
    if fit is not None:
        left = plates.add(
            residual_figure(series, fit), f"residuals-{which}", f"Residuals of the fit to {name}"
        )
        budget = noise_budget(series, fit)
        if budget is not None:
            noise = plates.add(
                noise_figure(budget), f"noise-{which}", f"Uncertainty of the values of {name}"
            )
    parts = tuple(budget.visible()) if budget else ()
    return _Figures(linear, logarithmic, left, noise, parts, values_below_axis(series))
