"""Report of an angular run: whether re-radiation depends on angle, and how sure that is."""

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np
from matplotlib.artist import Artist
from matplotlib.figure import Figure

from labrig.foundation.number_format import plus_minus
from labrig.protocols.angular_fluorescence.result import (
    AngularFluorescenceResult,
    SphereViews,
    YarnViews,
)
from labrig.report.figure_style import (
    BAND_OPACITY,
    DASHED,
    INK,
    LEFT_PT,
    MARKERS,
    MUTED,
    OTHER_CHANNELS,
    band_entry,
    error_bars,
    legend_above,
    line_entry,
    marker_entry,
    new_figure,
    place,
    points,
)
from labrig.report.sections import Picture, Rendered, Section, Source, Table
from labrig.results import LEVEL, POWER, DependenceTest, Measured

#: Least half height of the figure of ratios.
MIN_REACH = 0.02
#: Sideways shift of the series of one figure against each other, in degrees.
APART_DEG = 1.2
#: p below which no digits are told.
MIN_P = 1e-6


def render(result: AngularFluorescenceResult, source: Source) -> Rendered:
    """Render the answer, and the signal by angle or the shading of the sphere."""
    section = _yarn_section(result) if result.yarns else _sphere_section(result)
    return Rendered((section,), (f"angular fluorescence: {_answer(result)}",))


def _answer(result: AngularFluorescenceResult) -> str:
    """Return the sentence that answers whether re-radiation depends on angle."""
    tests = result.tests
    several = f" in {len(tests)} tests together" if len(tests) > 1 else ""
    if not result.finds_dependence:
        return (
            f"no dependence of re-radiation on angle is found ({_p(result.p)}{several}, level "
            f"{LEVEL:.0%}); {_power(result)} would have been found with {POWER:.0%} power"
        )
    name, test = min(_named_tests(result), key=lambda named: named[1].p)
    return (
        f"re-radiation depends on angle ({_p(result.p)}{several}): {name} it changes by "
        f"{_percent(test)}; {_power(result)} would have been found with {POWER:.0%} power"
    )


def _power(result: AngularFluorescenceResult) -> str:
    """Return the change that would have been found."""
    shadings = [views.shading for views in result.spheres if views.part == "re-radiated"]
    if not shadings:
        return f"a change of {result.detectable:.1%} from the least to the largest angle"
    by_view, by_incidence = (
        max(test.detectable for test in tests)
        for tests in zip(*((fit.by_view, fit.by_incidence) for fit in shadings), strict=True)
    )
    return f"a change of {by_view:.1%} by view or of {by_incidence:.1%} by incidence"


def _named_tests(result: AngularFluorescenceResult) -> Iterator[tuple[str, DependenceTest]]:
    """Yield the tests of the answer, each after what was changed."""
    for yarn in result.yarns:
        angles = yarn.means.angle_deg
        name = f"from {angles.min():g}° to {angles.max():g}°, {yarn.direction}, {yarn.led},"
        yield name, yarn.means.test
    for sphere in result.spheres:
        if sphere.part == "re-radiated":
            yield f"by view, {sphere.led},", sphere.shading.by_view
            yield f"by incidence, {sphere.led},", sphere.shading.by_incidence


def _p(p: float) -> str:
    return f"p < {MIN_P:g}" if p < MIN_P else f"p = {p:.2g}"


def _percent(test: DependenceTest) -> str:
    """Return an amplitude with its interval."""
    low, high = test.interval
    return f"{test.amplitude.value:+.1%} ({low:+.1%} to {high:+.1%})".replace("-", "−")


def _sentence(answer: str) -> str:
    return f"{answer[0].upper()}{answer[1:]}."


def _yarn_section(result: AngularFluorescenceResult) -> Section:
    first = result.yarns[0].means
    least, largest = first.angle_deg.min(), first.angle_deg.max()
    shared = 100 * (1 - first.test.level)
    return Section(
        "Dependence on angle",
        (
            _sentence(_answer(result)),
            f"Views of a yarn with {least:g}° to {largest:g}° between light and camera; it was put "
            "in anew for each of them. Means that are free for each angle are compared with a "
            "common one by Fisher's F, against the scatter of the placings and the noise of the "
            "camera; a steady drift is part of both. The change is that of a straight line from "
            f"the least to the largest angle, with its {shared:.3g} % interval.",
        ),
        (
            Picture(
                "angular",
                partial(_yarn_figure, result.yarns),
                "Re-radiated light over angle, relative to the mean of all angles; small: single "
                "views, the drift divided out; large: means with ± 1 σ; shaded: where 95 % of the "
                "means lie if nothing depends on angle.",
            ),
        ),
        (_yarn_table(result.yarns),),
    )


def _yarn_table(yarns: Sequence[YarnViews]) -> Table:
    tests = [views.means.test for views in yarns]
    means = [views.means for views in yarns]
    return Table(
        ("Yarn", *(f"{views.direction}, {views.led}" for views in yarns)),
        (
            ("channels", *(" + ".join(views.channels) for views in yarns)),
            ("p", *(_p(test.p).removeprefix("p = ") for test in tests)),
            (
                "F (degrees of freedom)",
                *(f"{test.statistic:.2f} ({test.dof[0]:g}, {test.dof[1]:g})" for test in tests),
            ),
            ("change", *(_percent(test) for test in tests)),
            (f"change found with {POWER:.0%} power", *(f"{test.detectable:.1%}" for test in tests)),
            ("scatter of placings", *(_measured_percent(each.scatter) for each in means)),
            ("drift", *(_measured_percent(each.drift) for each in means)),
            ("reflected at most", *(_fraction(views.reflected_at_most) for views in yarns)),
        ),
    )


def _measured_percent(fraction: Measured) -> str:
    return f"{plus_minus(100 * fraction.value, 100 * fraction.sigma)} %"


def _fraction(value: float) -> str:
    return "unknown" if np.isnan(value) else f"{value:.1%}"


def _yarn_figure(yarns: tuple[YarnViews, ...]) -> Figure:
    """Draw views and means over the angle, with the band of no dependence."""
    figure = new_figure(260.0)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=34)
    axes.axhline(1.0, color=MUTED, linewidth=0.9)
    entries: list[Artist] = []
    reach = MIN_REACH
    for number, views in enumerate(yarns):
        means = views.means
        colour = (INK, *OTHER_CHANNELS)[number % (1 + len(OTHER_CHANNELS))]
        marker = MARKERS[number % len(MARKERS)]
        shift = APART_DEG * (number - (len(yarns) - 1) / 2)
        axes.fill_between(
            means.angle_deg, 1 - means.band, 1 + means.band,
            color=colour, alpha=BAND_OPACITY / 2, linewidth=0,
        )  # fmt: skip
        points(axes, views.angle_deg + shift, means.ratio, marker, colour, "none", size=2.2)
        angle_deg = means.angle_deg + shift
        error_bars(axes, angle_deg, means.mean, means.mean_sigma, colour)
        points(axes, angle_deg, means.mean, marker, colour, colour, size=5.0)
        entries.append(marker_entry(f"{views.direction}, {views.led}", marker, colour))
        reach = max(reach, 1.15 * float(np.max(np.abs(means.ratio - 1))))
    entries.append(band_entry("no dependence, 95 %", MUTED))
    axes.set_ylim(1 - reach, 1 + reach)
    axes.set_xlabel("Angle between light and camera / °")
    axes.set_ylabel("Relative to all angles")
    legend_above(figure, entries, columns=4)
    return figure


def _sphere_section(result: AngularFluorescenceResult) -> Section:
    return Section(
        "Dependence on angle",
        (
            _sentence(_answer(result)),
            "A fabric on a sphere shows all angles of incidence at once. The fall-off of the light "
            "is divided out by its place; a scale and a small turn of the light are free in each "
            "view. Beside Lambert's law the radiance may change with the angle of view and with "
            "that of incidence: the result is the change from 0° to 90°, tested against the "
            "scatter between views and their common errors: distance of the light, outline, and "
            "lens.",
            *_lens(result.spheres),
        ),
        tuple(
            Picture(
                f"shading-{views.part}-{number}",
                partial(_sphere_figure, views),
                f"{views.part.capitalize()} light under {views.led} in {' + '.join(views.channels)}"
                " over the cosine of incidence, the fall-off divided out, in the scale of "
                "Lambert's law, and over it below; bars: ± 1 σ by the "
                "scatter between views. All directions of view are averaged.",
            )
            for number, views in enumerate(result.spheres, start=1)
        ),
        (_sphere_table(result.spheres),),
    )


def _lens(spheres: Sequence[SphereViews]) -> tuple[str, ...]:
    """Return a sentence about a lens that is not known."""
    if all(views.is_lens_known for views in spheres):
        return ()
    return (
        "The lens is not calibrated, and its possible distortion limits the smallest change by "
        "view that can be detected: run camera_calibration, and name its run in the rig file.",
    )


def _sphere_table(spheres: Sequence[SphereViews]) -> Table:
    fits = [views.shading for views in spheres]
    return Table(
        ("Light", *(f"{views.part}, {views.led}" for views in spheres)),
        (
            ("channels", *(" + ".join(views.channels) for views in spheres)),
            ("change by view", *(_percent(fit.by_view) for fit in fits)),
            ("p", *(_p(fit.by_view.p).removeprefix("p = ") for fit in fits)),
            (
                f"found with {POWER:.0%} power",
                *(f"{fit.by_view.detectable:.1%}" for fit in fits),
            ),
            ("change by incidence", *(_percent(fit.by_incidence) for fit in fits)),
            ("p", *(_p(fit.by_incidence.p).removeprefix("p = ") for fit in fits)),
            (
                f"found with {POWER:.0%} power",
                *(f"{fit.by_incidence.detectable:.1%}" for fit in fits),
            ),
            (
                "roughness (Oren–Nayar)",
                *(
                    f"{fit.roughness_deg.value:.2f} ± {fit.roughness_deg.sigma:.2f}°"
                    for fit in fits
                ),
            ),
            (
                "reflected at most",
                *(
                    _fraction(views.reflected_at_most) if views.part == "re-radiated" else "–"
                    for views in spheres
                ),
            ),
        ),
    )


def _sphere_figure(views: SphereViews) -> Figure:
    """Draw radiance over the cosine of incidence, with both laws."""
    shading = views.shading
    figure = new_figure(300.0)
    axes = place(figure, left=LEFT_PT, bottom=132, right=12, top=30)
    ratios = place(figure, left=LEFT_PT, bottom=38, right=12, top=178, share_x=axes)
    cosine, model = shading.cos_incidence, OTHER_CHANNELS[0]
    for panel, by in ((axes, np.ones_like(cosine)), (ratios, cosine)):
        panel.plot(cosine, cosine / by, color=MUTED, linewidth=1.2)
        panel.plot(cosine, shading.oren_nayar / by, color=model, ls=DASHED, linewidth=1.2)
        error_bars(panel, cosine, shading.radiance / by, shading.radiance_sigma / by, INK)
        points(panel, cosine, shading.radiance / by, MARKERS[0], INK, INK)
    reach = max(MIN_REACH, 1.2 * float(np.max(np.abs(shading.radiance / cosine - 1))))
    axes.set_xlim(0.3, 1.03)
    axes.set_ylim(0, 1.1)
    axes.tick_params(labelbottom=False)
    ratios.set_ylim(1 - reach, 1 + reach)
    ratios.set_xlabel("Cosine of the angle of incidence")
    axes.set_ylabel("Radiance")
    ratios.set_ylabel("Over Lambert")
    entries = [
        marker_entry(f"{views.part}, {views.led}", MARKERS[0], INK),
        line_entry("Lambert", MUTED),
        line_entry(f"Oren–Nayar, {shading.roughness_deg.value:.0f}°", model, DASHED),
    ]
    legend_above(figure, entries, columns=3)
    return figure
