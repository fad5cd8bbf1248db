"""What pages of the manual say of a campaign's output: sentences and rows of tables."""

import re

from tests.acceptance import (
    quoted_decay_fit,
    quoted_examples,
    quoted_rendering,
    quoted_samples,
)
from tests.acceptance.printed import Extract, columns, match, part, span
from tests.acceptance.quote import DECISIONS, EXPLANATION, HOW_TO, VALIDATION, Quote


def _charging(printed: str) -> str:
    row = r"^(0\.\d+) +([\d.]+)% +([\d.]+)% +([\d.]+)%$"
    rows = zip(*columns(row, printed), strict=True)
    return "\n".join(f"| {r:g} | {_two(a)} % | {_two(k)} % | {p:.1f} % |" for r, a, k, p in rows)


def _two_rates(printed: str) -> str:
    row = r"^(\d+)" + 8 * r" +([\d.]+)%" + r" *$"
    lines = []
    for ratio, *sigmas in zip(*columns(row, printed), strict=True):
        pairs = zip(sigmas[::2], sigmas[1::2], strict=True)
        cells = (f"{_two(fast)}, {_two(slow)}" for fast, slow in pairs)
        lines.append(f"| {ratio:g} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _two(percent: float) -> str:
    """Return a number with one decimal below ten, and none from there on."""
    return f"{percent:.1f}" if percent < 9.95 else f"{percent:.0f}"


def _approached(printed: str) -> dict[str, float]:
    return {name: float(r) for name, r in re.findall(r"^([a-z]+) +(0\.\d+)$", printed, re.M)}


def _approached_table(printed: str) -> str:
    rows = [f"{name} | {r:.2f}" for name, r in _approached(printed).items()]
    half = len(rows) // 2
    return "\n".join(f"| {a} | {b} |" for a, b in zip(rows[:half], rows[half:], strict=True))


def _approached_span(printed: str) -> str:
    known = _approached(printed).values()
    return (
        f"would have been {span(known, 2)}, so that $\\Lambda$ would be too small by a factor of "
        f"{1 / max(known):.0f} to {1 / min(known):.0f}"
    )


def _of_bound(printed: str) -> str:
    row = r"^\S+ +[\d.]+ +\d+ .* ([\d.]+) +[\d.]+$"
    ((*of_bound,),) = columns(row, printed.split("\n\n")[0])
    return f"scatter of the fitted rates is {span(of_bound, 2)} times the bound"


def _variable_filter(printed: str) -> str:
    (centre,) = columns(r"^ +centre / nm +[\d.]+ +([\d.]+)", printed)
    (width,) = columns(r"^ +width / 1 +[\d.]+ +([\d.]+)", printed)
    return (
        f"centres come out within {max(centre):.3f} nm from 420 to 680 nm and widths within "
        f"{100 * max(width):.1f} %"
    )


def _white_reference(printed: str) -> str:
    def of(camera: str) -> str:
        row = rf"^{camera} +the lamp  +([\d.]+) +([\d.]+)"
        ((mean,), (high,)) = columns(row, printed)
        return f"{mean:.2f} (95 %: {high:.2f})"

    with_card, without = of("another's, grey card"), of("another's, no card")
    return (
        f"the mean ΔE2000 of a ColorChecker is {with_card} with the picture of the grey card, and "
        f"{without} without"
    )


def _glare(printed: str) -> str:
    row = r"^glare [\d.]+%: of (\d+) samples (\d+) off by more than 2 σ, (\d+) with"
    (samples, _), (clean_far, far), (clean_other, other) = columns(row, printed)
    return (
        f"at $g$ = 0.5 % the rates of {far:.0f} of the {samples:.0f} samples of `decay-eleven` "
        f"were wrong by more than $2\\sigma$ and {other:.0f} had a wrong number of states, against "
        f"{clean_far:.0f} and {clean_other:.0f} without glare"
    )


def _charge_console(printed: str) -> str:
    return printed[printed.index("columns  time t") :].rstrip()


def _release(printed: str) -> str:
    def of(name: str) -> list[float]:
        ((*median,),) = columns(rf"^{name} +[AM]F +([\d.]+)", printed)
        return median

    (ours,) = {round(value) for value in of("ptp_camera")} or {0}
    button, trigger = (
        [value - ours for value in of(name)]
        for name in ("gphoto2, remote button", "gphoto2, trigger_capture")
    )
    return (
        f"release came {span(button)} ms later by the remote button, and {span(trigger)} ms later "
        "by trigger"
    )


def _lamp_off(printed: str) -> str:
    def at_most(way: str) -> str:
        (longest,) = columns(rf"^{way} +\d+ +[\d.]+ +([\d.]+)", printed)
        return f"{max(longest):.1f} s"

    return (
        f"off {at_most('kill -9')} at most after `kill -9`, and {at_most('SIGSTOP')} at most after "
        "labrig was stopped"
    )


def _starts(printed: str) -> str:
    row = r"^all +(\d+) +(\d+) +(\d+) +\d+/(\d+) +(\d+) +(\d+) "
    ((better,), (equal,), (worse,), (count,), (no_minimum,), (local,)) = columns(row, printed)
    return (
        f"On {count:.0f} problems, classical, NIST's and generated, from far and rank-deficient "
        f"starts the core is better than `trf` in {better:.0f}, equal in {equal:.0f} and worse in "
        f"{worse:.0f}; of the ends that it calls a minimum {no_minimum:.0f} are none and "
        f"{local:.0f} are local ones"
    )


def _certified(printed: str) -> str:
    first, second = columns(r"^\w+ +([\d.]+) +([\d.]+)$", part(printed, "NIST set"))
    return f"{min(*first, *second):.0f} digits"


def _mixture_scale(name: str) -> Extract:
    """Return the row of a scale: median and 90th percentile of ΔE2000 under four lights."""

    def extract(printed: str) -> str:
        row = r"^\d+ all, {} %: +[\d.]+e-6" + 4 * r" +([\d.]+) +[\d.]+%"
        medians, highs = (columns(row.format(percent), printed) for percent in (50, 90))
        pairs = ((low, high) for (low,), (high,) in zip(medians, highs, strict=True))
        cells = (f"{_colour(low)}, {_colour(high)}" for low, high in pairs)
        return f"| {name} | {' | '.join(cells)} |"

    return extract


def _colour(difference: float) -> str:
    """Return a ΔE2000 with as many decimals as are of use."""
    return f"{difference:.{2 if difference < 2 else 1 if difference < 10 else 0}f}"


#: Of `led_matrices`: median, 90 % and largest of two lights, by case.
_LED_CASE = r"^{} +([\d.]+) +([\d.]+) +([\d.]+) +([\d.]+) "


def _led_case(printed: str, case: str) -> list[float]:
    return [value for (value,) in columns(_LED_CASE.format(case), printed)]


def _leds_exact(printed: str) -> str:
    d65, a, high_d65, high_a = _led_case(printed, "exact")
    return (
        f"median ΔE2000 is {d65:.1f} under D65 and {a:.1f} under illuminant A (90 %: "
        f"{high_d65:.1f} and {high_a:.1f}) if the bench is known exactly"
    )


def _leds_calibrated(printed: str) -> str:
    d65, a, *_ = _led_case(printed, "calibrated")
    return f"{d65:.1f} and {a:.1f} if LEDs are known to 1 nm and the camera's curves to 3 %"


def _leds_otherwise(printed: str) -> str:
    alone, alone_a, *_ = _led_case(printed, "per-led")
    d65, a, high_d65, high_a = _led_case(printed, "reflecting")
    return (
        f"One LED by itself gives {alone:.1f} and {alone_a:.1f}; taken as not fluorescent, "
        f"{d65:.1f} and {a:.1f} (90 %: {high_d65:.1f} and {high_a:.1f})"
    )


def _entries(printed: str) -> str:
    """Return rms and worst of entries over σ, and rms of all light, of papers and of dyes."""
    rms, worst = columns(r"^ +entries +rms +([\d.]+),.* worst +([\d.]+),", printed)
    (light,) = columns(r"^ +light +rms +([\d.]+),", printed)
    papers, dyes = (f"{span(rms[k::2], 2)} (worst {max(worst[k::2]):.1f})" for k in (0, 1))
    return (
        f"entries are off by {papers} σ rms of measured papers and textiles, and by {dyes} of "
        f"measured dyes; all light by {span(light, 2)}"
    )


def _led_bench(printed: str) -> str:
    medians, highs = (
        columns(rf"^ *{percent} % +([\d.]+) +([\d.]+) ", printed) for percent in (50, 90)
    )
    (d65,), (a,) = medians
    (high_d65,), (high_a,) = highs
    rms = match(r"^errors over σ of .* rms ([\d.]+),", printed)
    return f"{d65:.2f} and {a:.2f} (90 %: {high_d65:.2f} and {high_a:.2f}; errors over σ {rms} rms)"


def _time_of_a_sample(printed: str) -> str:
    ((count,), (cpu_s,)) = columns(r"^(\d+) patches: .* each ([\d.]+) s,", printed)
    return f"The {count:.0f} samples of one capture take {cpu_s:.2f} s of one core each"


def _emissions(library: str) -> Extract:
    """Return the row of a library of emissions."""

    def extract(printed: str) -> str:
        rows = part(printed, "exact ")
        d65, a, high_d65, high_a = _led_case(rows, "exact")
        row = r"^ +median σ of L\*a\*b\* ([\d.]+) ([\d.]+); .* ([\d.]+)$"
        ((sigma, *_), (sigma_a, *_), (wrong, *_)) = columns(row, rows)
        return (
            f"| {library} | {d65:.2f}, {a:.2f} | {high_d65:.1f}, {high_a:.1f} | "
            f"{sigma:.1f}, {sigma_a:.1f} | {100 * wrong:.0f} % |"
        )

    return extract


def _tiles(printed: str) -> str:
    (count,) = columns(r"^(\d+) measurements of tiles", printed)
    rms = map(float, re.findall(r" ([\d.]+);", printed))
    ((as_measured, corrected),) = columns(r"^sums over columns, .*: rms ([\d.]+)", printed)
    return (
        f"On {count[0]:.0f} measurements of ceramic tiles, which do not re-radiate, the rms of "
        f"errors over σ is {span(rms, 2)}, by region, with and without these corrections; sums "
        f"over columns between 430 nm and 600 nm are off by {corrected:.3f} instead of "
        f"{as_measured:.3f}"
    )


def _most_that_returns(printed: str) -> str:
    ((count,), (most,)) = columns(r"^(\d+) other surfaces: up to ([\d.]+)", printed)
    return f"may do so (up to {most:.2f} of {count:.0f} measured surfaces)"


FLUORESCENT = f"{VALIDATION}/fluorescence.md"


def _light_errors(printed: str) -> str:
    pulls = dict(re.findall(r"^(?!layer)(.*): pulls ([\d.]+);", printed, re.M))
    blue = dict(re.findall(r"^(\S.*?) +blue-paint .* σ +([\d.]+) %  closure", printed, re.M))
    return "\n".join(
        f"| {case} | {pull} | {float(blue[case]):.1f} |" for case, pull in pulls.items()
    )


def _camera_curves(printed: str) -> str:
    rows = {
        "52 shipped, chart": "each of the 52 shipped, by the others",
        "52 shipped, chart and filter": "the same, with the filter",
        "32 of others, chart": "32 cameras of two other laboratories",
        "32 of others, chart and filter": "the same, with the filter",
    }
    lines = []
    for case, text in rows.items():
        row = rf"^{re.escape(case)} +([\d.]+)% +([\d.]+)% +([\d.]+)%  \S+ +[\d.]+% +([\d.]+)"
        median, most, worst, pulls = (column[0] for column in columns(row, printed))
        lines.append(f"| {text} | {median:.1f} % | {most:.1f} % | {worst:.1f} % | {pulls:.2f} |")
    return "\n".join(lines)


QUOTES = (
    Quote(f"{VALIDATION}/spectra.md", "camera_curves", _camera_curves),
    Quote(f"{VALIDATION}/phosphors.md", "excitation_light", _light_errors),
    *quoted_examples.QUOTES,
    *quoted_decay_fit.QUOTES,
    *quoted_rendering.QUOTES,
    *quoted_samples.QUOTES,
    Quote(f"{EXPLANATION}/identifiability.md", "rate_information", _charging),
    Quote(f"{EXPLANATION}/identifiability.md", "rate_information", _two_rates),
    Quote(f"{VALIDATION}/decays.md", "coverage_pipeline", _of_bound),
    Quote(f"{EXPLANATION}/phosphorescence.md", "rate_information", _approached_table),
    Quote(f"{EXPLANATION}/phosphorescence.md", "rate_information", _approached_span),
    Quote(f"{VALIDATION}/bench.md", "lvf_in_the_room", _variable_filter),
    Quote(f"{VALIDATION}/spectra.md", "spectrum_through_lvf", _white_reference),
    Quote(f"{VALIDATION}/decays.md", "veiling_glare", _glare),
    Quote(f"{VALIDATION}/decays.md", "reference_data", _certified),
    Quote(f"{DECISIONS}/0011-least-squares.md", "reference_data", _certified),
    Quote(f"{DECISIONS}/0011-least-squares.md", "least_squares_starts", _starts),
    Quote(f"{DECISIONS}/0006-own-ptp.md", "gphoto2_latency", _release),
    Quote(f"{DECISIONS}/0010-guard.md", "lamp_off_however_it_ends", _lamp_off),
    Quote(f"{HOW_TO}/fit_a_table.md", "sao_charge_and_decay", _charge_console),
    Quote(FLUORESCENT, "led_entries", _entries),
    Quote(FLUORESCENT, "led_matrices", _leds_exact),
    Quote(FLUORESCENT, "led_matrices", _leds_calibrated),
    Quote(FLUORESCENT, "led_matrices", _leds_otherwise),
    Quote(FLUORESCENT, "led_matrices", _emissions("none")),
    Quote(FLUORESCENT, "led_bench_calibrated", _led_bench),
    Quote(FLUORESCENT, "led_bench", _led_bench),
    Quote(FLUORESCENT, "led_bench_calibrated", _time_of_a_sample),
    Quote(FLUORESCENT, "led_bench_lamps", _led_bench),
    Quote(FLUORESCENT, "tile_noise", _tiles),
    Quote(FLUORESCENT, "tile_noise", _most_that_returns),
    Quote(FLUORESCENT, "led_matrices_library_others", _emissions("the other 43")),
    Quote(FLUORESCENT, "led_matrices_library_own", _emissions("all 44")),
    Quote(
        FLUORESCENT,
        "led_matrices_library_wrong",
        _emissions("two narrow lines each, which no material has"),
    ),
    *(
        Quote(
            f"{VALIDATION}/mixtures.md",
            f"mixture_colours_{name.replace(', ', '_')}",
            _mixture_scale(row),
        )
        for name, row in {
            "integral": "integral",
            "colour": "colour (D65, A, 450 nm)",
            "integral, skewed": "integral, skewed",
            "colour, skewed": "colour, skewed",
        }.items()
    ),
)
