"""What the page on rendering says of its campaigns."""

import re

from tests.acceptance.printed import match, part
from tests.acceptance.quote import EXPLANATION, Quote

PAGE = f"{EXPLANATION}/rendering.md"
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


QUOTES = (
    Quote(PAGE, "wavelength_noise", _noise),
    Quote(PAGE, "wavelength_noise", _bands),
    Quote(PAGE, "history_sampling", _history),
    Quote(PAGE, "history_sampling", _saturated),
    Quote(PAGE, "euler_steps", _steps),
    Quote(PAGE, "chart_colours", _charts),
)
