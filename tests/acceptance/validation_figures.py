"""Figures that say how good labrig is, and how each is found in what its campaign printed."""

import re
from dataclasses import dataclass

from tests.acceptance.printed import Extract, columns, furthest, match, part, span


@dataclass(frozen=True)
class Figure:
    """A row of the table.

    Attributes
    ----------
    what
        Truth, conditions, sample size.
    extract
        Function that finds the figure in the campaign's output.
    """

    what: str
    campaign: str
    extract: Extract


#: Of the pipeline's rows: within 1 σ, within 2 σ, bias in σ, scatter over the Cramér-Rao bound.
_RATE = (
    r"^\S+ +[\d.]+ +\d+ +([\d.]+) ± [\d.]+ +([\d.]+) ± [\d.]+ +([+-][\d.]+) ± [\d.]+"
    r" +[+-][\d.]+ +[\d.]+ +[\d.]+ +([\d.]+) +[\d.]+$"
)


def _coverage(scenario: str) -> Extract:
    def extract(printed: str) -> str:
        one, two, bias, _ = columns(_RATE, part(printed, scenario))
        return (
            f"{span(one)} % within 1 σ, {span(two)} % within 2 σ, "
            f"bias at most {furthest(bias):.2f} σ"
        )

    return extract


def _efficiency(printed: str) -> str:
    *_, of_bound = columns(_RATE, part(printed, "baseline"))
    return f"{span(of_bound, 2)} ×"


def _wrong_states(printed: str) -> str:
    ((seeds,),) = columns(r"^baseline.*: (\d+) seeds", printed)
    rows = part(printed, "baseline")
    wrong = {name: int(n) for name, n in re.findall(r"^([a-z-]+) +[\d.]+ +(\d+) ", rows, re.M)}
    return f"{sum(wrong.values())} of {seeds * len(wrong):.0f} fits"


def _decay_fit(printed: str) -> str:
    one, two = columns(r"within σ (\d+) %, 2σ (\d+) %", printed)
    return f"{span(one)} % within 1 σ, {span(two)} % within 2 σ"


def _power_laws(printed: str) -> str:
    (flagged,) = columns(r"^power law .*power law ([\d.]+) %", printed)
    return f"{span(flagged)} %"


def _certified(printed: str) -> str:
    first, second = columns(r"^\w+ +([\d.]+) +([\d.]+)$", part(printed, "NIST set"))
    return f"{span([*first, *second])} digits"


def _predicted(printed: str) -> str:
    (ratio, _) = columns(r"× ([\d.]+) +\S+ × ([\d.]+)", printed)
    return f"{span(ratio, 2)} × in {len(ratio)} rates"


def _told(printed: str) -> str:
    predicted, found = columns(r" k1 .* (\d+) % +(\d+) %$", printed)
    far = max(zip(predicted, found, strict=True), key=lambda pair: abs(pair[0] - pair[1]))
    return f"{far[0]:.0f} % predicted, {far[1]:.0f} % found"


def _excitation(printed: str) -> str:
    in_sigma, percent = columns(r"^[a-z]+ .* ([\d.]+) +([\d.]+)$", part(printed, "material"))
    return f"k_e within {max(percent):.1f} %, all within {max(in_sigma):.1f} σ"


def _excitation_sigma(printed: str) -> str:
    said = []
    for name in ("k_r", "Λ", "k_e"):
        (rms,) = columns(rf"^state \d  {name}[ \d]* ([\d.]+) +[+-]", printed)
        said.append(f"{name} {span(rms, 2)}")
    return ", ".join(said)


def _phosphor(printed: str) -> str:
    k_r, r0, percent, k_e, radiated = columns(
        r"k_r +(\S+) σ +r\(0\) .*? ([+-][\d.]+) σ +k_e +(\S+) % +(\S+) σ .* Λ +(\S+) σ", printed
    )
    return (
        f"k_e of bands ≥ 0.002 /s within {furthest(percent):.1f} % and {furthest(k_e):.1f} σ, "
        f"k_r within {furthest(k_r):.1f} σ, Λ within {furthest(radiated):.1f} σ, "
        f"r(0) within {furthest(r0):.1f} σ"
    )


def _phosphor_sigma(printed: str) -> str:
    names = {"k_r": "k_r", "r0_off": "r(0)", "k_e": "k_e", "radiated": "Λ"}
    rms = {name: match(rf" {name} ([\d.]+) σ", printed) for name in names}
    return ", ".join(f"{names[name]} {value}" for name, value in rms.items())


def _glow_colours(printed: str) -> str:
    means, largest = columns(r"ΔE ([\d.]+) \(([\d.]+)\)", printed)
    return f"mean {span(means, 2)}, largest {max(largest):.2f}"


def _each_sample(printed: str) -> str:
    return match(r"^each sample +(.*)$", printed)


def _variable_filter(printed: str) -> str:
    (centre,) = columns(r"^ +centre / nm +[\d.]+ +([\d.]+)", printed)
    (width,) = columns(r"^ +width / 1 +[\d.]+ +([\d.]+)", printed)
    return f"centres within {max(centre):.3f} nm, widths within {100 * max(width):.1f} %"


def _variable_filter_sigma(printed: str) -> str:
    said = []
    for name in ("centre / nm", "width / 1"):
        (rms,) = columns(rf"^ +{name} +[\d.]+ +[\d.]+ +[\d.]+ +([\d.]+)", printed)
        said.append(f"{name.split()[0]} {span(rms, 2)}")
    return ", ".join(said)


def _lamps(printed: str) -> str:
    said = []
    for role in ("fade", "rise"):
        ((rms,),) = columns(rf"^{role}, all of the above: ([\d.]+)$", printed)
        said.append(f"{role} {rms:.2f}")
    ((housing,),) = columns(r"^cold housing +([\d.]+)", printed)
    return f"{', '.join(said)}, light that a cold housing lacks {housing:.2f}"


def _irradiance(printed: str) -> str:
    (off,) = columns(r"^ +irradiance / 1 +[\d.]+ +([\d.]+)", printed)
    return f"{100 * max(off):.1f} %"


def _colours(camera: str) -> Extract:
    def extract(printed: str) -> str:
        row = rf"^{camera} +the lamp  +([\d.]+) +([\d.]+) +([\d.]+)"
        mean, percentile, largest = columns(row, printed)
        return f"mean {mean[0]:.2f}, 95 % {percentile[0]:.2f}, largest {largest[0]:.2f}"

    return extract


def _spectrum_bands(kind: str, camera: str) -> Extract:
    def extract(printed: str) -> str:
        row = rf"^{kind} +{camera} .* ([\d.]+)% +([\d.]+)%$"
        one, two = columns(row, printed)
        return f"{one[0]:.0f} %, {two[0]:.0f} %"

    return extract


def _lines(kind: str) -> Extract:
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


def _emission(printed: str) -> str:
    furthest, one, two = columns(r"^\S+ +yes +[\d.]+ +([\d.]+) +(\d+)% +(\d+)%", printed)
    return (
        f"within {100 * max(furthest):.1f} % of the peak; "
        f"{span(one)} % within 1 σ, {span(two)} % within 2 σ"
    )


def _decays(printed: str) -> str:
    pulls = [float(pull) for pull in re.findall(r"\(([+-][\d.]+) σ\)", printed)]
    wrong = len(re.findall("WRONG n|NOT FLAGGED", printed))
    return (
        f"{len(pulls)} rates within {furthest(pulls):.1f} σ; "
        f"{wrong} times a wrong number of states or a power law that is not flagged"
    )


def _real_charge(printed: str) -> str:
    rows = columns(r"^ +(\d) +([\d.]+) +([\d.]+) +([\d.]+) +([\d.]+) +([\d.]+)$", printed)
    two = [column[1] for column in rows]
    return f"{two[2]:.0f} %, {two[3]:.0f} %, {two[4]:.0f} %, {two[5]:.0f} %"


def _real_charge_of_general_order(printed: str) -> str:
    row = r"^reduced χ² +charge ([\d.]+) .*decay ([\d.]+) "
    ((charge,), (decay,)) = columns(row, printed)
    return f"{charge:.1f}, {decay:.1f}"


def _luminance_pulls(printed: str) -> str:
    parts = []
    for name in ("L10", "L60", r"t0\.3"):
        ((rms,), (sigma,)) = columns(rf"^{name} +([\d.]+) +-?[\d.]+ +([\d.]+)% +\d+$", printed)
        parts.append(f"{rms:.2f} at σ = {sigma:.1f} %")
    return ", ".join(parts)


def _light_errors(printed: str) -> str:
    # The last case is a thick layer, which no light explains.
    (pulls,) = columns(r"^(?!layer).*: pulls ([\d.]+);", printed)
    return f"rms of error over σ {span(pulls, 2)}"


def _trap_models(order: str) -> Extract:
    """Return the extract of how many materials were predicted how, processed with an order."""

    def extract(printed: str) -> str:
        row = re.compile(rf"^[\w.-]+ +{order} +b .* (\w+) +\d+ s$", re.MULTILINE)
        verdicts = row.findall(printed)
        kinds = ("good", "doubted", "told", "WRONG")
        return ", ".join(f"{verdicts.count(kind)} {kind}" for kind in kinds)

    return extract


def _narrow_lights(printed: str) -> str:
    thirds = columns(r"^every third.* ([\d.]+) +([\d.]+) +([\d.]+) +[\d.]+ +([\d.]+)$", printed)
    (low,), (median,), (high,), (worst,) = thirds
    return f"median {median:.1f} nm, quartiles {low:.1f} nm and {high:.1f} nm, worst {worst:.1f} nm"


def _narrow_lights_halved(printed: str) -> str:
    median = match(r"^every second.* ([\d.]+) +[\d.]+ +[\d.]+ +[\d.]+$", printed)
    return f"median {median} nm"


def _wrong(printed: str) -> str:
    wrong = match(r"^(\d+ of \d+) went wrong", printed)
    return f"{wrong} trials wrong"


def _kills(printed: str) -> str:
    *killed, wrong = columns(r"outside (\d+), writing (\d+), result (\d+) .* (\d+)$", printed)
    kills = sum(map(sum, killed))
    return f"{kills:.0f} kills in {len(wrong)} protocols, {sum(wrong):.0f} wrong"


def _disk(printed: str) -> str:
    failures, frames, wrong = columns(r"^(?:run|result), \w+ +(\d+) +(\d+) +\d+ +(\d+) ", printed)
    return (
        f"{sum(wrong):.0f} of {sum(failures):.0f} wrong (run not usable, an acknowledged frame of "
        f"{sum(frames):.0f} lost, more than one unit done again)"
    )


def _refused(printed: str) -> str:
    (longest_s,) = columns(r" ([\d.]+) s  ", printed)
    wrong = match(r"^(\d+ of \d+) went wrong", printed)
    return f"{wrong} wrong; longest refusal {max(longest_s):.1f} s"


def _containers(printed: str) -> str:
    cases, failures = columns(r"^.+? +(\d+) cases, (\d+) failures", printed)
    return f"{sum(failures):.0f} failures in {sum(cases):.0f} containers, {len(cases)} ways"


def _off_after(ways: str) -> Extract:
    """The longest of the ways to end that match."""

    def extract(printed: str) -> str:
        times = columns(rf"^(?:{ways}) +\d+ +[\d.]+ +([\d.]+|inf) +\d+$", printed)
        return f"at most {max(times[0]):.1f} s"

    return extract


def _latency(printed: str) -> str:
    said = []
    for name in ("ptp_camera", "gphoto2, remote button", "gphoto2, trigger_capture"):
        (median,) = columns(rf"^{name} +[AM]F +([\d.]+)", printed)
        said.append(f"{name} {span(median, 1)} ms")
    return "; ".join(said)


def _times(what: str, *peers: str) -> Extract:
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


def _laws(printed: str) -> str:
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


def _moving_light(printed: str) -> str:
    (percent,) = columns(r"^ +10*  +\S+ +([\d.]+) +[\d.]+ +\d+ ", printed)
    return f"{span(percent, 2)} % rms of the mean glow"


def _steps(printed: str) -> str:
    (errors,) = columns(r" exact +\S+ +\S+ +(\S+) ", printed)
    return f"within {max(errors):.5f}"


def _chart(printed: str) -> str:
    row = r"^BabelColor Average +BabelColor Average +{} +\S+ +\S+ +([\d.]+, [\d.]+)$"
    same, other = (match(row.format(light), printed) for light in ("D50", "D65"))
    return f"lit by D50 {same}; lit by D65 {other}"


def _single_wavelengths(printed: str) -> str:
    times = columns(
        r"^(?:furnace|sphere) +\d wavelengths? +" + 4 * r"\S+ +" + r"(\S+) +(\S+) +(\S+) +(\S+) ",
        printed,
    )
    spectrum, luminance = (*times[0], *times[2]), (*times[1], *times[3])
    return f"{span(spectrum)} × for spectra, {span(luminance, 1)} × for Y"


def _dark_rooms(printed: str) -> str:
    own, ratio = columns(r"^ +measured +ΔE +([\d.]+) .*ratio +(\S+) %", printed)
    (single,) = columns(r"^ +1 state +ΔE +([\d.]+)", printed)
    return (
        f"ΔE {span(own, 1)}, with one state {span(single, 1)}; ratio within "
        f"{furthest(ratio):.1f} % in the mean over time"
    )


def _camera_curves(case: str) -> Extract:
    def extract(printed: str) -> str:
        row = rf"^{case} +([\d.]+)% +[\d.]+% +([\d.]+)%  \S+ +[\d.]+% +([\d.]+)"
        median, worst, pulls = (column[0] for column in columns(row, printed))
        return f"median {median:.1f} %, worst {worst:.1f} %; rms of error over σ {pulls:.2f}"

    return extract


def _recovered_designs(printed: str) -> str:
    beyond, determined, rms = (
        match(pattern, printed)
        for pattern in (r"^beyond 3 σ: (\d+)", r"^beyond 3 σ: \d+ of (\d+)", r"; rms ([\d.]+)$")
    )
    return f"{beyond} of {determined} parameters beyond 3 σ, rms of error over σ {float(rms):.2f}"


def _fluorescent_rooms(printed: str) -> str:
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


FIGURES = (
    Figure(
        "Simulated dark room, from lamp to fit: samples of one and of two states, sensor of "
        "96 × 64 pixels, flicker of 0.7 %, 100 seeds. Fraction of the rates k_r within 1 σ and 2 σ "
        "of the truth (68 % and 95 % if σ is right; chance alone makes ± 5 % and ± 2 %), and mean "
        "error",
        "coverage_pipeline",
        _coverage("baseline"),
    ),
    Figure(
        "The same runs: fits that choose a wrong number of states",
        "coverage_pipeline",
        _wrong_states,
    ),
    Figure(
        "The same runs: scatter of the rates over the Cramér-Rao bound of the true noise",
        "coverage_pipeline",
        _efficiency,
    ),
    Figure(
        "The same with lamp drift of 3 %/h, crosstalk of 3 % and row noise of 0.3 read noise in "
        "addition, two decays, 100 seeds",
        "coverage_pipeline",
        _coverage("all of it"),
    ),
    Figure(
        "The same, reduced with another laboratory's camera curves, 60 seeds (chance alone makes "
        "± 6 % and ± 3 %)",
        "coverage_pipeline_other_scenarios",
        _coverage("another laboratory's curves"),
    ),
    Figure(
        "The same with lamp drift of 3 %/h, two decays, 60 seeds",
        "coverage_pipeline_other_scenarios",
        _coverage("lamp drifts"),
    ),
    Figure(
        "The same with flicker of 2 %, 60 seeds",
        "coverage_pipeline_other_scenarios",
        _coverage("flicker 2 %"),
    ),
    Figure(
        "The same without flicker, 60 seeds",
        "coverage_pipeline_other_scenarios",
        _coverage("steady light"),
    ),
    Figure(
        "A sample whose glow falls by a power law, 60 seeds: fits that say so",
        "coverage_pipeline_other_scenarios",
        lambda printed: match(r"flagged as such (\d+ of \d+)", printed),
    ),
    Figure(
        "Decay fit by itself, one to three states, flicker and dark level known or not, flicker "
        "that the fit does not allow for among them, 100 seeds in each case: fraction of the rates",
        "coverage_decay_fit",
        _decay_fit,
    ),
    Figure(
        "The same, power laws of three shapes, 100 seeds each: fraction of the fits that say so",
        "coverage_decay_fit",
        _power_laws,
    ),
    Figure(
        "Law of decay that the default protocol's fit takes, of two exponentials with rates 2.5, 5 "
        "and 20 apart, of general order 1.5, 2 and 3, and of one trap with retrapping of 0.1 and "
        "0.5 (general order counts as right), signal-to-noise ratio about 300, 100 seeds each; and "
        "of Table 1 and of the shipped double exponentials, which are of first order",
        "law_confusion",
        _laws,
    ),
    Figure(
        "Least-squares fit on the nonlinear reference sets of NIST, all 22 sets from both starts: "
        "digits in agreement with the certified parameters, of 11 certified",
        "reference_data",
        _certified,
    ),
    Figure(
        "Mercury lines of a real germicidal lamp: rms of four wavelengths about a straight line",
        "reference_data",
        lambda printed: match(r"^visible +\d+ +([\d.]+)$", printed) + " nm",
    ),
    Figure(
        "Scatter of fitted rates over the σ that `labrig plan --predict` states, materials of two "
        "states, 8 protocols, 32 runs each (chance alone makes ± 0.13)",
        "predicted_sigmas",
        _predicted,
    ),
    Figure(
        "Same runs: probability that both states are resolved, where prediction and runs differ "
        "most",
        "predicted_sigmas",
        _told,
    ),
    Figure(
        "Scatter over predicted σ for a material of one state, 6 protocols, 32 runs each",
        "predicted_sigmas_one_state",
        _predicted,
    ),
    Figure(
        "Excitation rates k_e ≥ 0.002 /s of Table 1's eight paints, charged by a numerical "
        "integration and a filament that cools, one seed",
        "excitation_rates",
        _excitation,
    ),
    Figure(
        "The same for a material of two states, 40 seeds: rms of error over σ (1 if σ is right)",
        "excitation_rates",
        _excitation_sigma,
    ),
    Figure(
        "A whole phosphor, all calibrations made in the run itself, Table 1's eight paints, "
        "one seed each",
        "whole_phosphor",
        _phosphor,
    ),
    Figure(
        "Same runs: rms of error over σ (1 if σ is right)",
        "whole_phosphor",
        _phosphor_sigma,
    ),
    Figure(
        "A phosphor measured with a calibration of the bench made once for all eight paints",
        "reused_calibration",
        _phosphor,
    ),
    Figure(
        "Same runs: rms of error over σ (1 if σ is right)",
        "reused_calibration",
        _phosphor_sigma,
    ),
    Figure(
        "Same runs: ΔE2000 of photographs of the glow from its measured spectrum and decay",
        "reused_calibration",
        _glow_colours,
    ),
    Figure(
        "Eight phosphors of a sample changer measured in turn in one run, with one calibration",
        "samples_in_turn",
        _phosphor,
    ),
    Figure(
        "Same run: rms of error over σ (1 if σ is right)",
        "samples_in_turn",
        _phosphor_sigma,
    ),
    Figure(
        "Same bench, frames of a 21-megapixel camera: what each further sample takes",
        "reused_calibration",
        _each_sample,
    ),
    Figure(
        "Linear variable filter calibrated in the simulated room with real colour filters, three "
        "cameras: central wavelengths and widths of the pass bands from 420 nm to 680 nm",
        "lvf_in_the_room",
        _variable_filter,
    ),
    Figure(
        "Same runs: rms of error over σ at all positions (1 if σ is right)",
        "lvf_in_the_room",
        _variable_filter_sigma,
    ),
    Figure(
        "Same runs: relative irradiance behind the filter, summed over all bands, from 420 nm to "
        "680 nm: largest error",
        "lvf_in_the_room",
        _irradiance,
    ),
    Figure(
        "Fade and rise of 100 halogen lamps, no two alike, by two passes of the protocol `fade`: "
        "rms of error over σ at five times after the switch in three bands (1 if σ is right)",
        "fade_pulls",
        _lamps,
    ),
    Figure(
        "ColorChecker under a halogen lamp through a variable filter, another laboratory's curves "
        "of the camera, their uncertainty and a picture of a grey card taken into account as "
        "`emission_spectrum` does by default: ΔE2000 of the 24 patches",
        "spectrum_through_lvf",
        _colours("another's, grey card"),
    ),
    Figure(
        "The same without the picture of the grey card (`white: false`)",
        "spectrum_through_lvf",
        _colours("another's, no card"),
    ),
    Figure(
        "The same with the other laboratory's curves taken for exact",
        "spectrum_through_lvf",
        _colours("another's, taken for exact"),
    ),
    Figure(
        "The same with the camera's true curves",
        "spectrum_through_lvf",
        _colours("same curves"),
    ),
    Figure(
        "Emission of 40 fluorophores through a variable filter, camera's true curves: fraction of "
        "the bands above 2 % of the peak within their credible bands of 68 % and 95 %",
        "spectrum_through_lvf",
        _spectrum_bands("fluorophores", "same curves"),
    ),
    Figure(
        "The same with another laboratory's curves and the picture of a grey card",
        "spectrum_through_lvf",
        _spectrum_bands("fluorophores", "another's, grey card"),
    ),
    Figure(
        "The same without the picture of the grey card",
        "spectrum_through_lvf",
        _spectrum_bands("fluorophores", "another's, no card"),
    ),
    Figure(
        "The same for 40 mercury lamps, whose lines are narrower than the filter's pass band, "
        "camera's true curves",
        "spectrum_through_lvf",
        _spectrum_bands("mercury lines", "same curves"),
    ),
    Figure(
        "Broad spectra through the variable filter, one or two bands of 30 to 120 nm: errors of "
        "the means over 10 nm above 2 % of the peak and of the mean over 50 nm about the peak, and "
        "how many are said to have lines",
        "spectrum_lines",
        _lines("broad"),
    ),
    Figure("The same of a line 5 nm wide", "spectrum_lines", _lines("line 5")),
    Figure("The same of a line 15 nm wide", "spectrum_lines", _lines("line 15")),
    Figure(
        "The same of a line 5 nm wide on a broad band", "spectrum_lines", _lines("line 5 on a band")
    ),
    Figure("The same of two lines 5 nm wide, 20 nm apart", "spectrum_lines", _lines("two 5 20")),
    Figure("The same of eight lines like those of Tb³⁺", "spectrum_lines", _lines("Tb")),
    Figure("The same of ten lines like those of Eu³⁺", "spectrum_lines", _lines("Eu")),
    Figure("The same of a mercury lamp", "spectrum_lines", _lines("mercury")),
    Figure(
        "Emission spectra of five paints in the simulated room, camera curves as far off as "
        "laboratories disagree, with a picture of a grey card, three seeds each: largest error, "
        "and fraction of the bands above 2 % of the peak",
        "emission_spectra",
        _emission,
    ),
    Figure(
        "Every shipped material in the simulated room, sensor of 384 × 256 pixels, by itself and "
        "Table 1's eleven in one charge, one seed",
        "decays_of_all_materials",
        _decays,
    ),
    Figure(
        "Real narrow-band lights from 400 nm to 700 nm, seen by a real sensor of 18 channels, "
        "every third held out in turn, four intensities: error of the wavelength",
        "lightlogger",
        _narrow_lights,
    ),
    Figure("The same, every second held out", "lightlogger", _narrow_lights_halved),
    Figure(
        "Every third held out: rms of error over σ (1 if σ is right)",
        "lightlogger",
        lambda printed: match(r"rms of error over σ ([\d.]+)$", printed),
    ),
    Figure(
        "Charge and decay of a real SrAl2O4:Eu,Dy, two states: rms of misfit over glow in the "
        "charge until 60 s, in the charge until 300 s, in the decay until 60 s, later",
        "sao_charge_and_decay",
        _real_charge,
    ),
    Figure(
        "The same by `labrig fit charge`, two states of general order: χ² per reading in the "
        "charge, in the decay",
        "sao_charge_and_decay",
        _real_charge_of_general_order,
    ),
    Figure(
        "Luminances of an afterglow at 10 and 60 min and its time until 0.3 mcd/m², measured with "
        "camera, grey card and a luxmeter of 3 %, over five laws of traps, 50 runs: rms of error "
        "over σ, at the median relative σ",
        "luminance_pulls",
        _luminance_pulls,
    ),
    Figure(
        "Excitation rates k_e ≥ 0.002 /s of six paints with the light as it is stated, and with "
        "places, wavelengths or the lamp further off than anybody says, 60 runs each",
        "excitation_light",
        _light_errors,
    ),
    Figure(
        "Charging by the white lamp and decay predicted from an excitation of traps of first and "
        "general order, with retrapping, and with depths that scatter, the order chosen by the "
        "data: within 2 % or 3 σ (good; doubted: and warned), worse and warned (told), not warned "
        "(WRONG)",
        "trap_models",
        _trap_models("auto"),
    ),
    Figure(
        "The same with the first order held",
        "trap_models",
        _trap_models("1"),
    ),
    Figure(
        "Faults of 15 kinds at random moments of a run, signals and kill -9 in addition; "
        "interrupted runs are resumed. 450 trials",
        "faults_at_any_moment",
        _wrong,
    ),
    Figure(
        "kill -9 at random moments of six of the shipped protocols and of the making of their "
        "results; resumed until complete, compared with an undisturbed run",
        "kills_in_every_protocol",
        _kills,
    ),
    Figure(
        "An I/O error or a loss of power at every third write, fsync, close, rename … of a run and "
        "of the making of its result; the run is resumed",
        "disk_failures",
        _disk,
    ),
    Figure(
        "Damaged YAML, CSV and journal files, 10 000 of them: refused with one line, or read",
        "mutated_files",
        _refused,
    ),
    Figure(
        "Damaged PTP containers over USB and network, 10 000 each way: no hang, no traceback",
        "ptp_fuzz",
        _containers,
    ),
    Figure(
        "Two labrigs on one relay board, by its path, a link, a relative path, two slashes, "
        "another TMPDIR; half of the 40 trials with the first at work, half at once",
        "two_labrigs",
        _wrong,
    ),
    Figure(
        "The PC sleeps for 1 s to 8 h at a random moment of a run (real process, the kernel's "
        "clock shimmed), 20 trials: reported, the unit done again",
        "suspended",
        _wrong,
    ),
    Figure(
        "Lamp off after a signal or a closed terminal, 10 trials each",
        "lamp_off_however_it_ends",
        _off_after(r"(?!SIGSTOP|SIGSEGV)SIG[^ ]+|closed terminal|Ctrl-Z"),
    ),
    Figure(
        "Lamp off after kill -9, SIGSEGV, or where memory runs out, 10 trials each",
        "lamp_off_however_it_ends",
        _off_after(r"kill -9|SIGSEGV|out of memory"),
    ),
    Figure("Lamp off after SIGSTOP, 10 trials", "lamp_off_however_it_ends", _off_after("SIGSTOP")),
    Figure(
        "The same where the board answers 60 ms late or has come back under another name",
        "lamp_off_however_it_ends",
        _off_after(r"board (?:60 ms late|renamed), .*?"),
    ),
    Figure(
        "The same where the board is silent for 20 s",
        "lamp_off_however_it_ends",
        _off_after(r"board silent for 20 s, SIGTERM"),
    ),
    Figure(
        "Delay from the command to the full press of the shutter release, simulated Canon, "
        "20 frames each: labrig's own driver and libgphoto2",
        "gphoto2_latency",
        _latency,
    ),
    Figure(
        "Curves of each of the 52 shipped cameras by a ColorChecker and the other cameras: root "
        "mean square error from 400 to 700 nm, relative to each channel's peak",
        "camera_curves",
        _camera_curves("52 shipped, chart"),
    ),
    Figure(
        "The same of 32 cameras that two other laboratories measured (rms 1 if σ is right)",
        "camera_curves",
        _camera_curves("32 of others, chart"),
    ),
    Figure(
        "The shipped materials of one or two states, found by the solver of `labrig design` from "
        "their own glow with noise of 1 %, 5 seeds",
        "design_recovery",
        _recovered_designs,
    ),
    Figure(
        "Glow behind a turning blade, 1 to 1000 s, by steps of a frame: error against the rate "
        "equation in 100,000 steps",
        "history_sampling",
        _moving_light,
    ),
    Figure(
        "Levels from 0 to 1 by 25 exact steps a second, four materials, steady and swinging light",
        "euler_steps",
        _steps,
    ),
    Figure(
        "ColorChecker in 20-nm bands, mean reflectances of 30 charts, against their published "
        "colours, which are under D50 and adapted to the screen: ΔE2000, mean and largest of 24 "
        "patches",
        "chart_colours",
        _chart,
    ),
    Figure(
        "Glow rendered from the files of simulated runs, 10 samples and rooms, beside photographs: "
        "ΔE2000 with the run's material, and with one state; glow over reflected light",
        "dark_room",
        _dark_rooms,
    ),
    Figure(
        "Fluorescent samples rendered under 4 lamps, beside photographs: shipped and measured "
        "papers and textiles, with the matrices of the room and as measured under LEDs",
        "fluorescent_room",
        _fluorescent_rooms,
    ),
    Figure(
        "Light in closed rooms with fluorescent papers: time of paths of 1 to 8 wavelengths over "
        "that of a fold in 24 bands, for equal noise",
        "wavelength_noise",
        _single_wavelengths,
    ),
    Figure(
        "Decay of two states, 60 frames in three channels: start, fit, alternative models, "
        "diagnosis",
        "benchmarks",
        _times(
            "2 states, 60 frames x 3 channels: all of it",
            "lmfit leastsq, best of 15 starts",
            "lmfit leastsq, one good start",
        ),
    ),
    Figure(
        "A frame of 25 MB and its journal line, durable",
        "benchmarks",
        _times("25 MB frame and its journal line, durable", "write and fsync of the same bytes"),
    ),
    Figure(
        "Excitation, 31 sites: residuals and Jacobian",
        "benchmarks",
        _times(
            "excitation, 31 sites, 3 charges: residuals and Jacobian",
            "solve_ivp in the loop, finite differences",
        ),
    ),
)
