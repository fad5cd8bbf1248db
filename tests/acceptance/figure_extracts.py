"""Functions that find a figure in what its campaign printed."""

import re
from statistics import median

from tests.acceptance.printed import Extract, columns, furthest, match, part, span

#: Of the pipeline's rows: within 1 σ, within 2 σ, bias in σ, scatter over the Cramér-Rao bound.
_RATE = (
    r"^\S+ +[\d.]+ +\d+ +([\d.]+) ± [\d.]+ +([\d.]+) ± [\d.]+ +([+-][\d.]+) ± [\d.]+"
    r" +[+-][\d.]+ +[\d.]+ +[\d.]+ +([\d.]+) +[\d.]+$"
)


def coverage(scenario: str) -> Extract:
    def extract(printed: str) -> str:
        one, two, bias, _ = columns(_RATE, part(printed, scenario))
        return (
            f"{span(one)} % within 1 σ, {span(two)} % within 2 σ, "
            f"bias at most {furthest(bias):.2f} σ"
        )

    return extract


def efficiency(printed: str) -> str:
    *_, of_bound = columns(_RATE, part(printed, "baseline"))
    return f"{span(of_bound, 2)} ×"


def wrong_states(printed: str) -> str:
    ((seeds,),) = columns(r"^baseline.*: (\d+) seeds", printed)
    rows = part(printed, "baseline")
    wrong = {name: int(n) for name, n in re.findall(r"^([a-z-]+) +[\d.]+ +(\d+) ", rows, re.M)}
    return f"{sum(wrong.values())} of {seeds * len(wrong):.0f} fits"


def decay_fit(printed: str) -> str:
    one, two = columns(r"within σ (\d+) %, 2σ (\d+) %", printed)
    return f"{span(one)} % within 1 σ, {span(two)} % within 2 σ"


def beating(printed: str) -> str:
    wrong = {
        spacing: columns(rf"^(\d) +{spacing} +sine (?:5\.1|4\.9|2\.55) s +([\d.]+)", printed)[1]
        for spacing in ("even", "random")
    }
    return f"{span(wrong['even'])} % evenly spaced, {span(wrong['random'])} % at random times"


def power_laws(printed: str) -> str:
    (flagged,) = columns(r"^power law .*power law ([\d.]+) %", printed)
    return f"{span(flagged)} %"


def certified(printed: str) -> str:
    first, second = columns(r"^\w+ +([\d.]+) +([\d.]+)$", part(printed, "NIST set"))
    return f"{span([*first, *second])} digits"


def predicted(printed: str) -> str:
    (ratio, _) = columns(r"× ([\d.]+) +\S+ × ([\d.]+)", printed)
    return f"{span(ratio, 2)} × in {len(ratio)} rates"


def told(printed: str) -> str:
    predicted, found = columns(r" k1 .* (\d+) % +(\d+) %$", printed)
    far = max(zip(predicted, found, strict=True), key=lambda pair: abs(pair[0] - pair[1]))
    return f"{far[0]:.0f} % predicted, {far[1]:.0f} % found"


def excitation(printed: str) -> str:
    in_sigma, percent = columns(r"^[a-z]+ .* ([\d.]+) +([\d.]+)$", part(printed, "material"))
    return f"k_e within {max(percent):.1f} %, all within {max(in_sigma):.1f} σ"


def excitation_sigma(printed: str) -> str:
    said = []
    for name in ("k_r", "Λ", "k_e"):
        (rms,) = columns(rf"^state \d  {name}[ \d]* ([\d.]+) +[+-]", printed)
        said.append(f"{name} {span(rms, 2)}")
    return ", ".join(said)


def phosphor(printed: str) -> str:
    k_r, r0, percent, k_e, radiated = columns(
        r"k_r +(\S+) σ +r\(0\) .*? ([+-][\d.]+) σ +k_e +(\S+) % +(\S+) σ .* Λ +(\S+) σ", printed
    )
    return (
        f"k_e of bands ≥ 0.002 /s within {furthest(percent):.1f} % and {furthest(k_e):.1f} σ, "
        f"k_r within {furthest(k_r):.1f} σ, Λ within {furthest(radiated):.1f} σ, "
        f"r(0) within {furthest(r0):.1f} σ"
    )


def phosphor_sigma(printed: str) -> str:
    names = {"k_r": "k_r", "r0_off": "r(0)", "k_e": "k_e", "radiated": "Λ"}
    rms = {name: match(rf" {name} ([\d.]+) σ", printed) for name in names}
    return ", ".join(f"{names[name]} {value}" for name, value in rms.items())


def glow_colours(printed: str) -> str:
    means, largest = columns(r"ΔE ([\d.]+) \(([\d.]+)\)", printed)
    return f"mean {span(means, 2)}, largest {max(largest):.2f}"


def albedo(printed: str) -> str:
    said = []
    for samples in (r"(?!step|fluorescent)", r"step"):
        rms, largest, off = columns(
            rf"^{samples}.* rms +([\d.]+)  largest +([\d.]+)  off ([\d.]+)", printed
        )
        said.append(
            f"rms {span(rms, 2)} σ, largest {max(largest):.1f} σ, errors up to {max(off):.3f}"
        )
    return f"{said[0]}; at a step of 15 nm {said[1]}"


def each_sample(printed: str) -> str:
    return match(r"^each sample +(.*)$", printed)


def variable_filter(printed: str) -> str:
    (centre,) = columns(r"^ +centre / nm +[\d.]+ +([\d.]+)", printed)
    (width,) = columns(r"^ +width / 1 +[\d.]+ +([\d.]+)", printed)
    return f"centres within {max(centre):.3f} nm, widths within {100 * max(width):.1f} %"


def variable_filter_sigma(printed: str) -> str:
    said = []
    for name in ("centre / nm", "width / 1"):
        (rms,) = columns(rf"^ +{name} +[\d.]+ +[\d.]+ +[\d.]+ +([\d.]+)", printed)
        said.append(f"{name.split()[0]} {span(rms, 2)}")
    return ", ".join(said)


def lamps(printed: str) -> str:
    said = []
    for role in ("fade", "rise"):
        ((rms,),) = columns(rf"^{role}, all of the above: ([\d.]+)$", printed)
        said.append(f"{role} {rms:.2f}")
    ((housing,),) = columns(r"^cold housing +([\d.]+)", printed)
    return f"{', '.join(said)}, light that a cold housing lacks {housing:.2f}"


def irradiance(printed: str) -> str:
    (off,) = columns(r"^ +irradiance / 1 +[\d.]+ +([\d.]+)", printed)
    return f"{100 * max(off):.1f} %"


def colours(camera: str) -> Extract:
    def extract(printed: str) -> str:
        row = rf"^{camera} +the lamp  +([\d.]+) +([\d.]+) +([\d.]+)"
        mean, percentile, largest = columns(row, printed)
        return f"mean {mean[0]:.2f}, 95 % {percentile[0]:.2f}, largest {largest[0]:.2f}"

    return extract


def spectrum_bands(kind: str, camera: str) -> Extract:
    def extract(printed: str) -> str:
        row = rf"^{kind} +{camera} .* ([\d.]+)% +([\d.]+)%$"
        one, two = columns(row, printed)
        return f"{one[0]:.0f} %, {two[0]:.0f} %"

    return extract


def lines(kind: str) -> Extract:
    """Return the extract of a kind of light's errors in σ, and of how many are warned of."""

    def extract(printed: str) -> str:
        rms, largest, near, said, count = columns(
            rf"^{kind} +([\d.]+) +([\d.]+) +([\d.]+) +[\d.]+% +[\d.]+% +(\d+)/(\d+)$", printed
        )
        return (
            f"{rms[0]:.1f} σ rms, at most {largest[0]:.1f} σ; of 50 nm {near[0]:.1f} σ rms; "
            f"{said[0]:.0f} of {count[0]:.0f}"
        )

    return extract


def emission(printed: str) -> str:
    furthest, one, two = columns(r"^\S+ +yes +[\d.]+ +([\d.]+) +(\d+)% +(\d+)%", printed)
    return (
        f"within {100 * max(furthest):.1f} % of the peak; "
        f"{span(one)} % within 1 σ, {span(two)} % within 2 σ"
    )


def decays(printed: str) -> str:
    pulls = [float(pull) for pull in re.findall(r"\(([+-][\d.]+) σ\)", printed)]
    wrong = len(re.findall("WRONG n|NOT FLAGGED", printed))
    return (
        f"{len(pulls)} rates within {furthest(pulls):.1f} σ; "
        f"{wrong} times a wrong number of states or a power law that is not flagged"
    )


def real_charge(printed: str) -> str:
    rows = columns(r"^ +(\d) +([\d.]+) +([\d.]+) +([\d.]+) +([\d.]+) +([\d.]+)$", printed)
    two = [column[1] for column in rows]
    return f"{two[2]:.0f} %, {two[3]:.0f} %, {two[4]:.0f} %, {two[5]:.0f} %"


def real_charge_of_general_order(printed: str) -> str:
    row = r"^reduced χ² +charge ([\d.]+) .*decay ([\d.]+) "
    ((charge,), (decay,)) = columns(row, printed)
    return f"{charge:.1f}, {decay:.1f}"


def luminance_pulls(printed: str) -> str:
    parts = []
    for name in ("L10", "L60", r"t0\.3"):
        ((rms,), (sigma,)) = columns(rf"^{name} +([\d.]+) +-?[\d.]+ +([\d.]+)% +\d+$", printed)
        parts.append(f"{rms:.2f} at σ = {sigma:.1f} %")
    return ", ".join(parts)


def luminance_times(printed: str) -> str:
    parts, held, open_, least, point_held = columns(
        r"^.{24} +(0\.\d) +([\d.]+) +([\d.]+) +\S+ +\S+ +([\d.]+) +([\d.]+) ", printed
    )
    from_half = [share for part, share in zip(parts, open_, strict=True) if part >= 0.5]
    return (
        f"{span(held)} % of the ranges in each cell, of the point fits' {span(point_held)} %; not "
        f"determined from half of the time on {span(from_half)} %; the earliest time holds in "
        f"{span(least)} %"
    )


def light_errors(printed: str) -> str:
    # The last case is a thick layer, which no light explains.
    (pulls,) = columns(r"^(?!layer).*: pulls ([\d.]+);", printed)
    return f"rms of error over σ {span(pulls, 2)}"


def layer_range(printed: str) -> str:
    rows = columns(
        r"^(?:optical|held out, all|thin).*: of +\d+ k_e +(\d+) % within 2 σ of the fit, +(\d+) %",
        printed,
    )
    return ", ".join(
        f"{before:.0f} % and {after:.0f} %" for before, after in zip(*rows, strict=True)
    )


def trap_models(order: str) -> Extract:
    """Return the extract of how many materials were predicted how, processed with an order."""

    def extract(printed: str) -> str:
        row = re.compile(rf"^[\w.-]+ +{order} +b .* (\w+) +\d+ s$", re.MULTILINE)
        verdicts = row.findall(printed)
        kinds = ("good", "doubted", "told", "WRONG")
        return ", ".join(f"{verdicts.count(kind)} {kind}" for kind in kinds)

    return extract


def narrow_lights(printed: str) -> str:
    thirds = columns(r"^every third.* ([\d.]+) +([\d.]+) +([\d.]+) +[\d.]+ +([\d.]+)$", printed)
    (low,), (median,), (high,), (worst,) = thirds
    return f"median {median:.1f} nm, quartiles {low:.1f} nm and {high:.1f} nm, worst {worst:.1f} nm"


def narrow_lights_halved(printed: str) -> str:
    median = match(r"^every second.* ([\d.]+) +[\d.]+ +[\d.]+ +[\d.]+$", printed)
    return f"median {median} nm"


def wrong(printed: str) -> str:
    wrong = match(r"^(\d+ of \d+) went wrong", printed)
    return f"{wrong} trials wrong"


def kills(printed: str) -> str:
    *killed, wrong = columns(r"outside (\d+), writing (\d+), result (\d+) .* (\d+)$", printed)
    kills = sum(map(sum, killed))
    return f"{kills:.0f} kills in {len(wrong)} protocols, {sum(wrong):.0f} wrong"


def disk(printed: str) -> str:
    failures, frames, wrong = columns(
        r"^(?:run|result), [\w -]+? +(\d+) +(\d+) +\d+ +(\d+) ", printed
    )
    return (
        f"{sum(wrong):.0f} of {sum(failures):.0f} wrong (run not usable, an acknowledged frame of "
        f"{sum(frames):.0f} lost, more than one unit done again)"
    )


def refused(printed: str) -> str:
    (longest_s,) = columns(r" ([\d.]+) s  ", printed)
    wrong = match(r"^(\d+ of \d+) went wrong", printed)
    return f"{wrong} wrong; longest refusal {max(longest_s):.1f} s"


def edited_beside_a_seal(printed: str) -> str:
    refused, named, same, silent = _edits(printed, "line alone|chain anew|seal removed")
    return f"{refused + named:.0f} of {refused + named + same + silent:.0f}"


def edited_without_a_seal(printed: str) -> str:
    refused, named, same, silent = _edits(printed, "result removed")
    return (
        f"{refused + named:.0f} of {refused + named + same + silent:.0f} refused or named, "
        f"{same:.0f} without an effect"
    )


def _edits(printed: str, ways: str) -> tuple[float, ...]:
    return tuple(map(sum, columns(rf"^(?:{ways}) +(\d+) +(\d+) +(\d+) +(\d+)$", printed)))


def went_wrong(printed: str) -> str:
    return f"{match(r'^([0-9]+ of [0-9]+) went wrong', printed)} wrong"


def growth(printed: str) -> str:
    return match(r"^((?:less|more) than .* stay)$", printed)


def containers(printed: str) -> str:
    cases, failures = columns(r"^.+? +(\d+) cases, (\d+) failures", printed)
    return f"{sum(failures):.0f} failures in {sum(cases):.0f} containers, {len(cases)} ways"


def off_after(ways: str) -> Extract:
    """The longest of the ways to end that match."""

    def extract(printed: str) -> str:
        times = columns(rf"^(?:{ways}) +\d+ +[\d.]+ +([\d.]+|inf) +\d+$", printed)
        return f"at most {max(times[0]):.1f} s"

    return extract


def latency(printed: str) -> str:
    said = []
    for name in ("ptp_camera", "gphoto2, remote button", "gphoto2, trigger_capture"):
        (median,) = columns(rf"^{name} +[AM]F +([\d.]+)", printed)
        said.append(f"{name} {span(median, 1)} ms")
    return "; ".join(said)


def times(what: str, *peers: str) -> Extract:
    def extract(printed: str) -> str:
        row = r"^{} +(\d\S* \S+) \(.*?\) +{} +(\d\S* \S+) \("
        ours = match(row.format(re.escape(what), ".*?"), printed)
        theirs = [
            match(row.format(re.escape(what), re.escape(peer)).replace("(", "(?:", 1), printed)
            for peer in peers
        ]
        said = (f"{peer} {time}" for peer, time in zip(peers, theirs, strict=True))
        return "; ".join((f"labrig {ours}", *said))

    return extract


def becquerel_minima(printed: str) -> str:
    (n,), (far,) = columns(r"background free .*?of (\d+) laws (\d+) end", printed)
    return f"{far:.0f} of {n:.0f}"


def law_minima(printed: str) -> str:
    pattern = r"any decay .*?of (\d+) laws .*?, (\d+) more than .*?of (\d+) pairs (\d+) fit"
    (n,), (near,), (pairs,), (nested,) = columns(pattern, printed)
    return f"{near:.0f} of {n:.0f}; {nested:.0f} of {pairs:.0f}"


def laws(printed: str) -> str:
    of_laws = columns(
        r"^(?:two rates|general|one trap).*right +([\d.]+) %.*wrong +([\d.]+) %", printed
    )
    of_materials = columns(r"^[a-z]+-?\S*  .*right +([\d.]+) %.*?([\d.]+) % beyond 3 σ", printed)
    right, silent = of_laws
    first_order, beyond = of_materials
    return (
        f"right in {span(right)} %, wrong without a word at most {max(silent):g} %; "
        f"of first order {span(first_order)} %, rates beyond 3 σ at most {max(beyond):g} %"
    )


def moving_light(printed: str) -> str:
    (percent,) = columns(r"^ +10*  +\S+ +([\d.]+) +[\d.]+ +\d+ ", printed)
    return f"{span(percent, 2)} % rms of the mean glow"


def steps(printed: str) -> str:
    (errors,) = columns(r" exact +\S+ +\S+ +(\S+) ", printed)
    return f"within {max(errors):.5f}"


def chart(printed: str) -> str:
    row = r"^BabelColor Average +BabelColor Average +{} +\S+ +\S+ +([\d.]+, [\d.]+)$"
    same, other = (match(row.format(light), printed) for light in ("D50", "D65"))
    return f"lit by D50 {same}; lit by D65 {other}"


def single_wavelengths(printed: str) -> str:
    times = columns(
        r"^(?:furnace|sphere) +\d wavelengths? +" + 4 * r"\S+ +" + r"(\S+) +(\S+) +(\S+) +(\S+) ",
        printed,
    )
    spectrum, luminance = (*times[0], *times[2]), (*times[1], *times[3])
    return f"{span(spectrum)} × for spectra, {span(luminance, 1)} × for Y"


def dark_rooms(printed: str) -> str:
    own, ratio = columns(r"^ +measured +ΔE +([\d.]+) .*ratio +(\S+) %", printed)
    (single,) = columns(r"^ +1 state +ΔE +([\d.]+)", printed)
    return (
        f"ΔE {span(own, 1)}, with one state {span(single, 1)}; ratio within "
        f"{furthest(ratio):.1f} % in the mean over time"
    )


def predicted_room(printed: str) -> str:
    sides = match(r"glow over reflected light in \w: (.*)$", printed)
    return f"{sides}; ΔE {match(r'^ +measured +ΔE +([0-9.]+)', printed)}"


def overheads(printed: str) -> str:
    row = r"^(\S+): (.* ms with, .* ms without phosphorescence), "
    return "; ".join(f"{name}: {text}" for name, text in re.findall(row, printed, re.MULTILINE))


def results_after(printed: str) -> str:
    row = r"^reduced ahead: (yes|no) +result after (.* s); at 99 %: (.*)$"
    rows = re.findall(row, printed, re.MULTILINE)
    names = {"yes": "with", "no": "without"}
    return "; ".join(f"{names[ahead]} {after} ({shots})" for ahead, after, shots in rows)


def gains(printed: str) -> str:
    gain, rms, line = columns(
        r"^loss .* gain +(\S+) ± .* rms (\S+) σ; bend .* straight line (\S+) ±", printed
    )
    return f"{span(gain, 3)}, rms {span(rms, 2)} σ, by a straight line {span(line, 2)}"


def read_noises(printed: str) -> str:
    (rms,) = columns(r"^noise .* stated: .* rms (\S+) σ", printed)
    below = re.findall(r"(\d+) below \S+, (\d+) truly", printed)
    limits, truly = (sum(map(int, numbers)) for numbers in zip(*below, strict=True))
    return f"median {median(rms):.2f} σ, largest {max(rms):.2f} σ; {truly} of {limits} limits"


def camera_curves(case: str) -> Extract:
    def extract(printed: str) -> str:
        row = rf"^{case} +([\d.]+)% +[\d.]+% +([\d.]+)%  \S+ +[\d.]+% +([\d.]+)"
        median, worst, pulls = (column[0] for column in columns(row, printed))
        return f"median {median:.1f} %, worst {worst:.1f} %; rms of error over σ {pulls:.2f}"

    return extract


def recovered_designs(printed: str) -> str:
    beyond, determined, rms = (
        match(pattern, printed)
        for pattern in (r"^beyond 3 σ: (\d+)", r"^beyond 3 σ: \d+ of (\d+)", r"; rms ([\d.]+)$")
    )
    return f"{beyond} of {determined} parameters beyond 3 σ, rms of error over σ {float(rms):.2f}"


def fluorescent_rooms(printed: str) -> str:
    said = []
    for matrices in ("files", "measured"):
        cases = re.findall(rf"^\w+, {matrices},(?:.|\n)*?(?=^\S)", printed, re.M)
        broad, pulls = columns(r"^ +(?!ultra)\w+ +ΔE +([\d.]+) .* ([\d.]+) σ", "".join(cases))
        dark, others = columns(r"^ +ultraviolet +ΔE +([\d.]+) .* ([\d.]+) σ", "".join(cases))
        said.append(
            f"{matrices}: ΔE {span(broad, 1)}, under ultraviolet {span(dark, 1)}, all within "
            f"{max(*pulls, *others):.1f} σ"
        )
    return "; ".join(said)


def intervals(printed: str) -> str:
    """Fractions of the truths that intervals hold, and that ± σ holds."""
    row = r"68 %: interval +([\d.]+)\(.*?±σ +([\d.]+) .*?interval +([\d.]+)\(.*?±1.96 σ +([\d.]+)"
    narrow, by_sigma, wide, by_two = columns(row, printed)
    return (
        f"{span(narrow)} % and {span(wide)} % in the intervals, {span(by_sigma)} % and "
        f"{span(by_two)} % within ± 1 σ and ± 1.96 σ"
    )


def announced_end(printed: str) -> str:
    """Return how late the end announced at resume was, and how often by less than 2 s."""
    row = r"^all +\d+ +([-+.\d]+) to ([-+.\d]+), (\d+) of (\d+)"
    (low,), (high,), (near,), (n,) = columns(row, printed)
    late = f"late by {low:+.1f} to {high:+.1f} s".replace("-", "−")
    return f"{late}; by less than 2 s in {near:.0f} of {n:.0f}"
