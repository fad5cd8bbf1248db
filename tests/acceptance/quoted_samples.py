"""Quotes in the manual of selected lights, camera filters, and samples in turn."""

import re
from collections.abc import Iterator
from functools import partial

from tests.acceptance.printed import Extract, columns, furthest, match, span
from tests.acceptance.quote import VALIDATION, Quote

#: Middles of the LEDs' bands in nm that the page takes together, and those that it names.
MAX_NM, NAMED_NM = (455, 495, 530, 565, 605), (640, 680, 415)
#: Words of the page's table by the name of each way of selecting lights, and its rooms.
WAYS = {
    "filters": ("8 filters in 8 bands of 37.5 nm", ("smooth", "steps")),
    "monochromator": (
        "monochromator, 20 nm, in the same bands, read by a spectrometer",
        ("smooth", "steps"),
    ),
    "leds": ("8 LEDs, 22 nm, in the same bands, read by a spectrometer", ("smooth", "steps")),
    "fine": ("monochromator, 20 nm, in 15 bands of 20 nm", ("smooth",)),
    "narrow": ("monochromator, 8 nm, in 15 bands of 20 nm", ("smooth",)),
}


def _leds_by_camera(printed: str) -> str:
    rows = columns(r"^(\d+) nm: off by +([\d.]+) % rms", printed)
    off = dict(zip(*rows, strict=True))
    first, second, ultraviolet = (f"{off[nm]:.0f}" for nm in NAMED_NM)
    one, two, largest = (
        match(rf"^all .* {pattern}", printed)
        for pattern in (r"(\d+) % within 1 σ", r"(\d+) % within 2 σ", r"([\d.]+) σ at most")
    )
    return (
        f"those from {MAX_NM[0]} to {MAX_NM[-1]} nm were off by "
        f"{span(off[nm] for nm in MAX_NM)} % (rms), at 640 and 680 nm by {first} and {second} %, "
        f"and at 415 nm by {ultraviolet} %; {one} % within σ and {two} % within 2 σ, none beyond "
        f"{largest} σ"
    )


def _camera_filters(printed: str) -> str:
    rms, most, centroid = columns(
        r"off by +([\d.]+) % of the peak rms, +([\d.]+) % at .*centroid off by +([+-][\d.]+)",
        printed,
    )
    pulls = match(r"^pulls of rms ([\d.]+)", printed)
    return (
        f"Λ* is off by {span(rms)} % of its peak (rms; a variable filter: 2.5 % or less), by "
        f"{max(most):.0f} % at most at a steep flank, with pulls of rms {pulls}; centroids by "
        f"{furthest(centroid):.0f} nm at most"
    )


def _selected_lights(way: str) -> Extract:
    """Return the extract of a row of the table."""
    words, rooms = WAYS[way]

    def extract(printed: str) -> str:
        cells = [words]
        for room in ("smooth", "steps"):
            if room not in rooms:
                cells += ["", ""]
                continue
            row = rf"^{way} +{room} +k_e off by +([\d.]+) % rms, +([\d.]+) % at most; ([\d.]+) σ"
            ((rms,), (most,), (pull,)) = columns(row, printed)
            cells += [f"{rms:.0f} %, {most:.0f} %", f"{pull:.1f} σ"]
        return re.sub(" +", " ", f"| {' | '.join(cells)} |")

    return extract


def _unequal_filling(printed: str) -> str:
    def counted(samples: str, said: str, what: str) -> int:
        lines = re.findall(rf"^{samples}.*{said}: ([^;\n]*)", printed, re.M)
        return sum(int(n) for line in lines for n in re.findall(rf"\b{what} (\d+)", line))

    seeds = sum(columns(r"^two rates .* (\d+) seeds", printed)[0])
    of_order = sum(columns(r"^general order .* (\d+) seeds", printed)[0])
    order = "(?<!no )order"
    told, alone = counted("two rates", "said", order), counted("two rates", "test", "general order")
    right = counted("general order", "said", order)
    alike = counted("general order", "test", "not decided")
    return (
        f"Of {seeds:.0f} samples of two such states, charged for 10 s, 1 min and 10 min, "
        f"{told or 'none'} is given an order, where the exponents alone would give one to {alone}; "
        f"of {of_order:.0f} samples of general order {right} are given one, and of {alike} the "
        "charges do not differ enough to decide"
    )


def _lab_times(printed: str) -> str:
    def times(samples: int, rest: str) -> Iterator[str]:
        row = rf"^{samples} samples, {rest} +in turn at most (.*), one after the other (.*)$"
        found = re.search(row, printed, re.M)
        assert found is not None
        yield from found.groups()

    short, long = times(2, "rests of the chain"), times(2, "long rests")
    many = times(8, "long rests")
    return (
        f"two samples take at most {next(short)} in turn and {next(short)} one after the other; "
        "with `rest: {below: 2 %, at_least: 1 min, at_most: 15 min}`, after which hardly anything "
        f"is left of a charge, {next(long)} and {next(long)}, and eight samples {next(many)} and "
        f"{next(many)}"
    )


def _in_turn(printed: str) -> str:
    percent, k_e = columns(r"k_e +(\S+) % +(\S+) σ", printed)
    rms_percent = float(match(r"k_e_percent ([\d.]+) %", printed))
    rms = match(r"k_e ([\d.]+) σ,", printed)
    return (
        f"excitation rates (of 0.002 /s or more) within {furthest(percent):.1f} % and "
        f"{furthest(k_e):.1f} σ of the truth, {rms_percent:.1f} % and {rms} σ in the mean "
        "square"
    )


def _budget(printed: str) -> str:
    def of(way: str, column: int) -> str:
        cells = re.split(r" {2,}", match(rf"^{way} +(.*)$", printed))
        return cells[column]

    names = re.split(r" {2,}", match(r"^emission +(.*)$", printed))
    colour, light, two = (names.index(name) for name in ("colour", "L10", "with a second meter"))
    shutter, reading = (of("three channels", names.index(name)) for name in ("shutter", "reading"))
    three, filters = (partial(of, way) for way in ("three channels", "camera filters"))
    return (
        f"σ of a green glow at 10 min is {three(light)} %: {three(colour)} % by its colour, "
        f"{reading} % by the reading, {shutter} % by shutter times. A run of `emission_spectrum` "
        f"through ten filters before the camera lowers that of the colour to {filters(colour)} %, "
        f"and σ to {filters(light)} %; the mean of two meters as the reading by itself lowers it "
        f"to {three(two)} %, and both together to {filters(two)} %"
    )


PHOSPHORS = f"{VALIDATION}/phosphors.md"
QUOTES = (
    Quote(PHOSPHORS, "leds_by_camera", _leds_by_camera),
    Quote(f"{VALIDATION}/spectra.md", "camera_filters", _camera_filters),
    *(Quote(PHOSPHORS, "selected_lights", _selected_lights(way)) for way in WAYS),
    Quote(PHOSPHORS, "unequal_filling", _unequal_filling),
    Quote(f"{VALIDATION}/luminance.md", "luminance_budget", _budget),
    Quote(PHOSPHORS, "samples_in_turn", _lab_times),
    Quote(PHOSPHORS, "samples_in_turn", _in_turn),
)
