"""Figures of rendering on the page of the validation."""

import re

from tests.acceptance.printed import furthest, match, part, span
from tests.acceptance.quote import VALIDATION, Quote

PAGE = f"{VALIDATION}/rendering.md"
METHODS = ("fold, 24 bands", "1 wavelength", "4 wavelengths", "8 wavelengths")
#: Cases and methods of the table, as the campaign and as the page call them.
NOISE_ROWS = (
    *((case, method) for case in ("furnace", "sphere") for method in METHODS),
    ("plane, even lamp", "fold, 24 bands"),
    ("plane, even lamp", "4 wavelengths"),
    ("plane, lamp of 1 nm", "fold, 24 bands"),
    ("plane, lamp of 1 nm", "4 wavelengths"),
    ("plane, lamp of 1 nm", "4 wavelengths, balanced"),
)
HISTORY = ("blue-paint, 1 state, κ/k at most 0.0001", "yellow-paint, 1 state, κ/k at most 0.0001")
SATURATED = "blue-paint, glow of the law"
#: Samples and rooms, as the campaign and as the page call them.
ROOMS = {
    "two-states": "two states, 0.08 and 0.016 /s",
    "two-states-wide": "two states, 0.2 and 0.01 /s",
    "two-states-slow": "two states, one of them slow",
    "two-states-no-door": "the first of them on a bench without a door",
    "wide-no-door": "the second of them on a bench without a door",
    "known-camera": "the first of them before a camera whose curves are the file's",
    "blue-paint": "one state",
    "order-1.5": "order 1.5",
    "two-states-faint": "two states, one faint, and a glow of 10⁻⁶ of the card's light at last",
    "otor-0.5": "one trap with retrapping",
}
LAMPS = ("daylight", "halogen", "xenon", "ultraviolet")
SAMPLES = {
    "shipped": "shipped ones",
    "textiles": "textiles and a golf ball",
    "papers": "papers and textiles",
}
#: Column of the step of 0.04 s, a video's frame.
FRAME_STEP = 2


def _noise(printed: str) -> str:
    table = part(printed, "yellow paper as measured")
    lines = []
    for case, method in NOISE_ROWS:
        numbers = match(rf"^{re.escape(case)} +{re.escape(method)}  +(.*)$", table).split()
        spectrum, luminance, _, _, *times = numbers[:8]
        cells = (f"{float(spectrum):.2g}", f"{float(luminance):.2g}", *map(_rounded, times))
        lines.append(f"| {case} | {method} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _rounded(number: str) -> str:
    """Return a factor with two digits, without an exponent."""
    return f"{float(f'{float(number):.1e}'):,.10g}"


def _bands(printed: str) -> str:
    rows = re.findall(r"fold, 24 bands .* ([+-][\d.]+)$", printed, re.M)
    return f"{max(abs(float(percent)) for percent in rows):.1f} % of Y at most"


def _history(printed: str) -> str:
    lines = []
    for title in HISTORY:
        name = title.split(",")[0]
        for row in part(printed, title).splitlines()[3:]:
            t_s, _, field, _, *equal = row.split()
            _, of_frame, _, n, random, strata, quality, *times = equal
            cells = (
                f"{name}, {t_s} s", f"{float(field):.2g} %", f"{float(of_frame):.2g} %", n,
                f"{float(random):.2g} %", f"{float(strata):.2g} %", quality,
                *map(_rounded, times),
            )  # fmt: skip
            lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _saturated(printed: str) -> str:
    rows = re.findall(r"^ +([\d.]+) +([\d.]+) +[\d.]+$", part(printed, SATURATED), re.M)
    law = {float(saturation): float(ratio) for saturation, ratio in rows}
    return (
        f"{100 * (law[0.01] - 1):.1f} % too bright at κ/k = 0.01, {100 * (law[0.1] - 1):.0f} % at "
        f"0.1 and {law[3.0]:.1f} times as bright as it should be at 3"
    )


def _steps(printed: str) -> str:
    lines = []
    for light in ("|E| = 1, steady", "|E| = 1, swinging", "|E| = 10, swinging"):
        rows = re.findall(
            r"^(\S+-paint) .* (Euler|Runge-Kutta|exact) (.*)$", part(printed, light), re.M
        )
        for method in ("Euler", "Runge-Kutta", "exact"):
            errors = [float(row.split()[FRAME_STEP]) for _, own, row in rows if own == method]
            said = " | ".join(f"{error:.0e}".replace("e-0", " × 10⁻").replace("e-", " × 10⁻")
                              for error in errors)  # fmt: skip
            lines.append(f"| {light.replace('|E|', 'E')} | {method} | {_raised(said)} |")
    return "\n".join(lines)


def _charts(printed: str) -> str:
    rows = re.findall(r"^(\S+ \S+(?: \S+)?)  +(\S.*?)  +(D50|D65|C) +(.*?)  +(.*)$", printed, re.M)
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def _raised(text: str) -> str:
    """Return a text whose exponents are superscripts."""
    return re.sub(
        r"⁻(\d+)", lambda found: "⁻" + "".join("⁰¹²³⁴⁵⁶⁷⁸⁹"[int(c)] for c in found[1]), text
    )


def _rooms(printed: str) -> str:
    lines = []
    for name, said in ROOMS.items():
        case = match(rf"(^{re.escape(name)}: (?:.|\n)*?)(?=^\S|\Z)", printed)
        light = match(r"reflected by the (?:grey )?(\w+)", case)
        delta_e, ratio = (
            match(rf"^ +measured +{pattern}", case)
            for pattern in (r"ΔE +([\d.]+)", r".*ratio +(\S+) %")
        )
        single = match(r"^ +1 state +ΔE +([\d.]+)", case)
        noise, matched = (
            match(pattern, case)
            for pattern in (r"noise alone ΔE ([\d.]+)", r"^ +measured .*matched +([\d.]+)")
        )
        numbers = (f"{float(each):.1f}" for each in (delta_e, noise, matched))
        cells = (said, light, *numbers, _signed(ratio), f"{float(single):.1f}")
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _signed(percent: str) -> str:
    return f"{float(percent):+.1f} %".replace("-", "−")


def _furthest_photograph(printed: str) -> str:
    pulls = re.findall(r"^ +measured .* (\S+) σ$", printed, re.M)
    return f"No photograph is further than {furthest(map(float, pulls)):.1f} σ"


def _lamps(printed: str) -> str:
    lines = []
    for matrices in ("files", "measured"):
        for samples, said in SAMPLES.items():
            case = match(rf"(^{samples}, {matrices},(?:.|\n)*?)(?=^\S|\Z)", printed)
            rows = [match(rf"^ +{lamp} +(.*)$", case) for lamp in LAMPS]
            found = [
                "{} ({})".format(*(match(rf"{word} +([\d.]+)", row) for word in ("ΔE", "alone")))
                for row in rows
            ]
            most = furthest(float(match(r"([\d.]+) σ", row)) for row in rows)
            lines.append(f"| {said} | {matrices} | {' | '.join(found)} | {most:.1f} σ |")
    return "\n".join(lines)


def _blue(printed: str) -> str:
    rows = re.findall(r"^ +blue +ΔE +([\d.]+) .*alone +([\d.]+), .* ([\d.]+) σ", printed, re.M)
    delta_e, alone, sigmas = (list(map(float, column)) for column in zip(*rows, strict=True))
    return (
        f"Under a narrow blue lamp mean ΔE is {span(delta_e, 1)} (errors alone: {span(alone, 1)}), "
        f"and no value is further than {max(sigmas):.1f} σ"
    )


def _reflected(printed: str) -> str:
    cases = re.findall(r"^\w+, (?:files|measured),(?:.|\n)*?(?=^\S)", printed, re.M)
    found = re.findall(r"^ +(?:daylight|halogen|xenon) .*reflected +([\d.]+)", "".join(cases), re.M)
    return f"Of reflected light alone, ΔE is {span(map(float, found))} under the first three lamps"


def _must_not_agree(printed: str) -> str:
    felt, card, leds = (
        furthest(map(float, re.findall(r"([\d.]+) σ", match(rf"(^{name},(?:.|\n)*?)^\S", printed))))
        for name in ("felt for paper", "card glows", "LEDs not calibrated")
    )
    return (
        f"a paper rendered with the matrix of a felt is up to {felt:.0f} σ away, samples beside a "
        f"card that fluoresces up to {card:.0f} σ, and samples measured under LEDs of unknown "
        f"brightness up to {leds:.0f} σ"
    )


QUOTES = (
    Quote(PAGE, "dark_room", _rooms),
    Quote(PAGE, "dark_room", _furthest_photograph),
    Quote(PAGE, "fluorescent_room", _lamps),
    Quote(PAGE, "fluorescent_room", _blue),
    Quote(PAGE, "fluorescent_room", _reflected),
    Quote(PAGE, "fluorescent_room", _must_not_agree),
    Quote(PAGE, "wavelength_noise", _noise),
    Quote(PAGE, "wavelength_noise", _bands),
    Quote(PAGE, "history_sampling", _history),
    Quote(PAGE, "history_sampling", _saturated),
    Quote(PAGE, "euler_steps", _steps),
    Quote(PAGE, "chart_colours", _charts),
)
