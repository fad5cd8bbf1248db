"""Published colours of a ColorChecker beside those that a bench measures."""

from collections.abc import Iterator

import numpy as np

from labrig.analyse.chart_scene import chart_scene
from labrig.analyse.colours import camera_matrix
from labrig.analyse.inputs import Part
from labrig.bench_optics import camera_curves, card_reflectance, lamp_spectrum
from labrig.optics import CHART_PATCHES, read_colour_chart
from labrig.protocols.colour_check.analysis.colours import GRID_NM, PublishedChart, checked
from labrig.protocols.colour_check.analysis.plain import PlainColours, plain_colours
from labrig.protocols.colour_check.analysis.through import ThroughColours, through_colours
from labrig.protocols.colour_check.protocol import CheckFrames
from labrig.protocols.colour_check.result import CheckedPatch, ColourCheckResult, ColourSummary

#: Pull of the card's balance, misfit of the card through the filter, and shift of its strip in nm,
#: from which something has changed.
ODD_BALANCE, ODD_MISFIT, MOVED_NM = 3.5, 2.5, 2.0


def analyse(part: Part) -> ColourCheckResult:
    """Compare a chart's colours, in a plain photograph and through the LVF, with published ones.

    Raises
    ------
    UsageError
        The rig file lacks curves of camera, lamp or grey card, or the filter's calibration.
    DataError
        Frames are missing or damaged, or no chart is to be seen in them.
    """
    rig, protocol = part.rig, part.protocol
    lamp, camera = lamp_spectrum(rig), camera_curves(rig, part.overrides.camera)
    chart = PublishedChart.under(read_colour_chart(protocol.chart), lamp)
    scene = chart_scene(part, CheckFrames.CHART, CheckFrames.CARD)
    matrix = camera_matrix(camera, lamp)
    # On the grid of the sums, and on the scale on which a white has Y = 1.
    values_of_white = chart.light @ camera.at(GRID_NM)
    matrix = matrix * chart.white[1] / (matrix @ values_of_white)[1]
    plain = plain_colours(scene, chart, camera, card_reflectance(rig), matrix)
    through = through_colours(part, chart)
    every = tuple(range(len(CHART_PATCHES)))
    plainly, of_plain = checked(chart, every, plain.xyz, plain.drawn)
    filtered, of_through = (
        ({}, None) if through is None else checked(chart, through.rows, through.xyz, through.drawn)
    )
    published, pictures = chart.lab(chart.xyz), chart.picture(chart.xyz)
    return ColourCheckResult(
        camera=camera.name,
        lamp=lamp.name,
        chart=protocol.chart,
        patches={
            name: CheckedPatch(published[row], pictures[row], plainly[row], filtered.get(row))
            for row, name in enumerate(CHART_PATCHES)
        },
        plain=of_plain,
        through=of_through,
        channels=camera.channels,
        card_balance=plain.balance,
        card_balance_sigma=plain.balance_sigma,
        card_misfit=None if through is None else through.misfit,
        filter_shift_nm=None if through is None else through.shift_nm,
        warnings=(
            *_plain_warnings(of_plain, plain, camera.channels),
            *_through_warnings(of_through, through),
        ),
    )


def _plain_warnings(
    summary: ColourSummary, plain: PlainColours, channels: tuple[str, ...]
) -> Iterator[str]:
    if summary.verdict == "differs":
        yield (
            f"plainly: ΔE2000 is {summary.mean:.1f} on average, {summary.allowed:.1f} is what "
            f"errors allow (most {summary.worst}, {summary.largest:.1f}); the camera's curves are "
            "those of another camera, or the chart is another one, faded or in glare"
        )
    pulls = (plain.balance - 1) / plain.balance_sigma
    worst = int(np.abs(pulls).argmax())
    if abs(pulls[worst]) > ODD_BALANCE:
        yield (
            f"the grey card is {plain.balance[worst] - 1:+.0%} off in {channels[worst]}, "
            f"{abs(pulls[worst]):.1f} σ; the lamp's spectrum or the camera's curves are not those "
            "of the rig file"
        )


def _through_warnings(
    summary: ColourSummary | None, through: ThroughColours | None
) -> Iterator[str]:
    if summary is None or through is None:
        return
    if summary.verdict == "differs":
        yield (
            f"through the filter: ΔE2000 is {summary.mean:.1f} on average, {summary.allowed:.1f} "
            f"is what errors allow (most {summary.worst}, {summary.largest:.1f}); a patch did not "
            "fill the strip, or the filter is not as it was calibrated: run lvf_calibration again"
        )
    if abs(through.shift_nm) > MOVED_NM:
        yield (
            f"the filter's strip lies {through.shift_nm:+.1f} nm along itself from where it was "
            "calibrated: it was moved, or the camera was; put it back, or run lvf_calibration again"
        )
    if through.misfit > ODD_MISFIT:
        yield (
            f"the grey card through the filter differs {through.misfit:.1f} times as much as "
            "errors allow from what lamp, filter and camera make of it; the lamp or the camera's "
            "curves are not those of the rig file, or the filter is not as it was calibrated"
        )
