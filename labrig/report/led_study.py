"""Sets of LEDs compared: as text, as JSON and as a page."""

import json
from dataclasses import dataclass

import numpy as np

from labrig.fit.fluorescence import LedSet, usual_led
from labrig.foundation.number_format import aligned
from labrig.record import RunDescription
from labrig.report.chart import (
    Axis,
    Chart,
    Line,
    Margins,
    Mark,
    Panel,
    Points,
    linear_axis,
    logarithmic_axis,
)
from labrig.report.figure_style import CHANNEL, DASHED, INK, MARKERS, MUTED, OTHER_CHANNELS, PAPER
from labrig.report.page import Report
from labrig.report.sections import Picture, Section, Table

#: Colours of the lights in turn.
COLOURS = (INK, OTHER_CHANNELS[1], OTHER_CHANNELS[0], OTHER_CHANNELS[2], *CHANNEL.values())
HEIGHT_PT, ROW_PT, NAMES_PT = 300.0, 24.0, 110.0
#: Least ΔE2000 on a logarithmic axis.
LEAST = 0.01
RECOMMENDED = "recommended"


@dataclass(frozen=True, eq=False)
class ComparedLeds:
    """Sets of LEDs, all judged by the same surfaces under the same lights.

    Attributes
    ----------
    sets
        The sets, at least one, in order of their numbers of LEDs.
    camera
        Name of the camera.
    of_surfaces
        Words on the surfaces, such as `4 shipped materials`.
    """

    sets: tuple[LedSet, ...]
    camera: str
    of_surfaces: str

    @property
    def lights(self) -> tuple[str, ...]:
        """Names of the lights."""
        return self.sets[0].study.lights

    def to_json(self) -> str:
        """Return placements, peaks in nm, and ΔE2000 of each surface and its quantiles as text."""
        content = {
            "camera": self.camera,
            "lights": list(self.lights),
            "surfaces": list(self.sets[0].study.surfaces),
            "sets": [
                {
                    "placement": one.placement,
                    "peaks_nm": list(one.peaks_nm),
                    "median": _numbers(one.study.quantile(0.5)),
                    "quantile_90": _numbers(one.study.quantile(0.9)),
                    "delta_e": [_numbers(row) for row in one.study.delta_e],
                }
                for one in self.sets
            ],
        }
        return json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False)


def _numbers(values: np.ndarray) -> list[float | None]:
    return [round(float(value), 4) if np.isfinite(value) else None for value in values]


def describe_leds(compared: ComparedLeds) -> str:
    """Describe sets of LEDs in lines of text.

    Parameters
    ----------
    compared
        The sets.

    Returns
    -------
    str
        A line for each set: number, placement, median and 90 % quantile of ΔE2000, peaks.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.fit.fluorescence import LedSet, LedStudy
    >>> from labrig.report import ComparedLeds, describe_leds
    >>> study = LedStudy(("felt", "paper"), ("D65",), np.array([[0.5], [1.0]]))
    >>> compared = ComparedLeds((LedSet("even", (400, 500, 600), study),), "mine", "2 papers")
    >>> print(describe_leds(compared).splitlines()[-1])
    3     even       0.75, 0.95  400 500 600
    """
    head = f"ΔE2000, median and 90 %, over {compared.of_surfaces}; camera: {compared.camera}"
    return "\n".join([head, *aligned([_head(compared), *_rows(compared)])])


def _head(compared: ComparedLeds) -> tuple[str, ...]:
    return ("LEDs", "placement", *compared.lights, "peaks / nm")


def _rows(compared: ComparedLeds) -> list[tuple[str, ...]]:
    return [
        (
            str(len(one.peaks_nm)),
            one.placement,
            *(
                f"{median:.2f}, {most:.2f}"
                for median, most in zip(
                    one.study.quantile(0.5), one.study.quantile(0.9), strict=True
                )
            ),
            " ".join(f"{peak:g}" for peak in one.peaks_nm),
        )
        for one in compared.sets
    ]


def led_study_report(compared: ComparedLeds, about: RunDescription) -> Report:
    """Return the page of a comparison of sets of LEDs.

    Parameters
    ----------
    compared
        The sets.
    about
        Description of the processing.

    Returns
    -------
    Report
        Errors against the number of LEDs, the placements, and how they were found.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.fit.fluorescence import LedSet, LedStudy
    >>> from labrig.record import RunDescription
    >>> from labrig.report import ComparedLeds, led_study_report
    >>> study = LedStudy(("felt", "paper"), ("D65",), np.array([[0.5], [1.0]]))
    >>> compared = ComparedLeds((LedSet("even", (400, 500, 600), study),), "mine", "2 papers")
    >>> about = RunDescription(
    ...     title="LEDs", protocol="led_study", run="", started="", ended="", rig="",
    ...     simulated=False, labrig_version="0.1.0"
    ... )
    >>> [section.title for section in led_study_report(compared, about).sections]
    ['How many LEDs', 'Where they are']
    """
    return Report(about, (), (_numbers_section(compared), _places(compared)), (_methods(compared),))


def _numbers_section(compared: ComparedLeds) -> Section:
    table = Table(
        ("LEDs", *_head(compared)[1:-1]),
        tuple(row[:-1] for row in _rows(compared)),
        f"ΔE2000, median and 90 % quantile, over {compared.of_surfaces}.",
    )
    picture = Picture(
        "error",
        _error_chart(compared),
        "Median ΔE2000 of the estimated surfaces under each light, by the number of LEDs. Under a "
        "narrow light the white is that of a screen, with the surface at half its luminance.",
    )
    return Section("How many LEDs", (), (picture,), (table,))


def _places(compared: ComparedLeds) -> Section:
    table = Table(
        ("set", "peaks / nm"),
        tuple(
            (_name(one), " ".join(f"{peak:g}" for peak in one.peaks_nm)) for one in compared.sets
        ),
    )
    picture = Picture(
        "placement",
        _placement_chart(compared),
        "Peaks of the LEDs; lines: their full widths at half maximum.",
    )
    return Section("Where they are", (), (picture,), (table,))


def _name(one: LedSet) -> str:
    return f"{len(one.peaks_nm)} {one.placement}"


def _placements(compared: ComparedLeds) -> list[str]:
    return list(dict.fromkeys(one.placement for one in compared.sets))


def _error_chart(compared: ComparedLeds) -> Chart:
    marks: list[Mark] = []
    legend: list[tuple[str, Mark]] = []
    every = []
    for index, light in enumerate(compared.lights):
        colour = COLOURS[index % len(COLOURS)]
        for order, placement in enumerate(_placements(compared)):
            sets = [one for one in compared.sets if one.placement == placement]
            number = np.array([float(len(one.peaks_nm)) for one in sets])
            error = np.array([one.study.quantile(0.5)[index] for one in sets]).clip(LEAST)
            is_first = order == 0
            line = Line(colour, number, error) if is_first else Line(
                colour, number, error, width_pt=0.8, style=DASHED
            )  # fmt: skip
            marker = MARKERS[order % len(MARKERS)]
            points = Points(
                colour, number, error, marker=marker, face="" if is_first else PAPER, size_pt=5.0
            )
            marks += [line, points]
            every += error[np.isfinite(error)].tolist()
            if is_first:
                legend.append((light, points))
            if index == 0:
                entry = Points(MUTED, marker=marker, face=points.face, size_pt=5.0)
                legend.append((placement, entry))
    legend.sort(key=lambda entry: entry[0] not in compared.lights)
    numbers = sorted({len(one.peaks_nm) for one in compared.sets})
    axis = Axis(
        "Number of LEDs", numbers[0] - 1, numbers[-1] + 1, tuple((n, str(n)) for n in numbers)
    )
    low, high = (min(every), max(every)) if every else (LEAST, 1.0)
    panel = Panel(
        axis,
        logarithmic_axis("Median ΔE2000", low / 1.5, high * 1.5),
        tuple(marks),
        Margins(top=46.0),
    )
    return Chart((panel,), HEIGHT_PT, legend=tuple(legend), columns=max(len(compared.lights), 2))


def _placement_chart(compared: ComparedLeds) -> Chart:
    rows = list(reversed(compared.sets))
    marks: list[Mark] = []
    for row, one in enumerate(rows):
        is_recommended = one.placement == RECOMMENDED
        peaks = np.array(one.peaks_nm, dtype=np.float64)
        for peak in peaks:
            led = usual_led(float(peak))
            half = led.wavelength_nm[led.value >= 0.5][[0, -1]]
            marks.append(Line(INK, half, np.full(2, float(row)), width_pt=1.6, opacity=0.45))
        face = "" if is_recommended else PAPER
        marks.append(Points(INK, peaks, np.full(len(peaks), float(row)), face=face, size_pt=5.5))
    ends = [peak for one in compared.sets for peak in one.peaks_nm]
    panel = Panel(
        linear_axis("Wavelength / nm", min(min(ends) - 25, 350), max(max(ends) + 25, 675)),
        Axis("Set", -0.7, len(rows) - 0.3, tuple((n, _name(one)) for n, one in enumerate(rows))),
        tuple(marks),
        Margins(left=NAMES_PT, top=10.0),
    )
    return Chart((panel,), 48.0 + ROW_PT * (len(rows) + 0.4))


def _methods(compared: ComparedLeds) -> Section:
    points = (
        "Each surface's matrix is lit by LEDs of Gaussian shape, as wide as LEDs of their colour "
        "usually are, and photographed in three channels with 0.2 % noise. LEDs, brightnesses and "
        "curves are known exactly: a bench, on which they are not, does worse.",
        f"The camera is {compared.camera}.",
        "From these values the matrix is estimated as from a run of led_fluorescence, and its "
        "colours are compared with those of the measured matrix.",
        "'recommended' are the sets that a search found over 44 measured matrices; 'even' ones are "
        "evenly spaced from 380 nm to 640 nm.",
        "An LED excites only dyes that absorb its wavelength: without an ultraviolet LED, "
        "colours under ultraviolet light are extrapolated.",
    )
    return Section("How it was found", points=points)
