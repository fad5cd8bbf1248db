"""What pages of the manual show of the commands that `manual_examples` runs for them."""

import re

from tests.acceptance.printed import Extract, columns, match, part, span
from tests.acceptance.quote import EXPLANATION, HOW_TO, VALIDATION, Quote


def _console(command: str) -> Extract:
    """Return all that the command printed that begins so; with a line break it is all of it."""

    def extract(printed: str) -> str:
        typed = re.escape(command) if command.endswith("\n") else rf"{re.escape(command)}.*\n"
        return match(rf"^\$ labrig {typed}((?:(?!\$ ).*\n?)*)", printed).strip()

    return extract


def _lines(first: str, last: str, command: str) -> Extract:
    """Return a command's lines from one that begins so to one that begins so."""

    def extract(printed: str) -> str:
        text = _console(command)(printed)
        return match(rf"^({first}.*(?:\n.*)*?\n?{last}.*)$", text)

    return extract


def _line(pattern: str, command: str = "") -> Extract:
    """Return the part of a line that matches, of a command or of all that was printed."""

    def extract(printed: str) -> str:
        return match(f"({pattern})", _console(command)(printed) if command else printed)

    return extract


def _tutorial_rate(printed: str) -> str:
    shown = match(r"^1 +([\d.]+\(\d+\)) ", printed)
    value = match(r"k_r 1 (\S+ ± \S+) →", printed)
    return f"`{shown}` is {value} per second"


def _refitted(printed: str) -> str:
    again = printed[printed.index("$ labrig process") :]
    return "\n".join(match(row, again) for row in (r"^(state  k .*)$", r"^(1  .*)$"))


def _changed(printed: str) -> str:
    return match(r"^  (k_r 1 .*? σ\); a 1 .*? σ\));", printed)


_COMPARED = "runs compare 2026-01-01 2026-01-02"


def _transient(which: str) -> Extract:
    return _line(rf"the {which} transient .* in the last; over after [\d.]+ s;", "run fade")


def _afterglow(printed: str) -> str:
    chi2 = match(r"χ² ([\d.]+) a degree", _console("run fade --rig ./afterglow.yaml")(printed))
    return f"With an afterglow of 0.01 % that fades within a minute it is {chi2}"


def _curves_of(printed: str) -> str:
    file = match(r"3 curves \(.*?(/config/.*)\)", printed)
    return f"Canon EOS 5D Mark II: 3 curves (…{file})"


def _direct_sigma(printed: str) -> str:
    (sigma,) = columns(r"σ of a band ([\d.e-]+)\)", printed)
    return f"On the simulated bench it is {span(sigma, 5)} per band of 10 nm"


def _direct(printed: str) -> str:
    row = r"spectrometer \| ([\d.]+) \| ([\d.]+) \|"
    (together, alone), (together_a, alone_a) = columns(row, printed)
    return (
        f"is {together:.1f} and {together_a:.1f} from the direct measurement by all LEDs together, "
        f"and {alone:.1f} and {alone_a:.1f} by one LED by itself"
    )


DARK_ROOM, CAMERA = f"{HOW_TO}/dark_room.md", f"{HOW_TO}/own_camera.md"
DAYS, FLUORESCENT = f"{HOW_TO}/compare_days.md", f"{HOW_TO}/fluorescent.md"
QUOTES = (
    Quote("docs/tutorial.md", "manual_refit", _tutorial_rate),
    Quote(f"{HOW_TO}/refit.md", "manual_refit", _refitted),
    Quote(f"{HOW_TO}/refit.md", "manual_refit", _changed),
    *(
        Quote(DAYS, "manual_compare_days", text)
        for text in (
            _console("runs list"),
            _console(f"{_COMPARED}\n"),
            _console(f"{_COMPARED} --reference"),
            _lines("patch +1 state", "paper, 11", "reproduce last\n"),
            _lines("Measured: ", "k_e was not", "reproduce last --material"),
            _lines("runs/", "  4 of 4", "runs show"),
            _lines("    states: ", "    1 ", "runs show"),
        )
    ),
    *(
        Quote(DARK_ROOM, "manual_dark_room", text)
        for text in (
            _lines("free of", "stray light: ", "run blank --rig sim-phosphor"),
            _line("light of .* leaks in", "run blank --rig ./leak.yaml"),
            _line("never free of the turn-off transient", "run blank --rig ./leak.yaml"),
            _transient("turn-off"),
            _transient("turn-on"),
            _line("a cold lamp has .*", "run fade"),
            _line("labrig: .*", "plan"),
            _line("Begun after its planned time.*\\."),
        )
    ),
    Quote(f"{EXPLANATION}/calibrations.md", "manual_dark_room", _afterglow),
    *(
        Quote(CAMERA, "manual_own_camera", text)
        for text in (
            _lines("camera: ", "  refuse ", "rig check ./my-rig.yaml"),
            _lines(" +release asked", " +exposure over", "rig check sim"),
            _lines(" +for the rig file", " +for the rig file.*frame_size", "rig check sim"),
            _curves_of,
            _line("R  380.*", "optics show"),
            _line("G  380.*", "optics show"),
            _line("B  380.*", "optics show"),
            _lines("ISO 100", "ISO 200", "run camera_calibration"),
            _lines("flicker ", "aperture: ", "run camera_calibration"),
            _line(
                r"vignetting: corners, beyond the card, at .*? at f/4,", "run camera_calibration"
            ),
        )
    ),
    Quote(
        f"{HOW_TO}/luminance.md",
        "manual_luminance",
        lambda printed: part(printed, "time / min"),
    ),
    Quote(f"{HOW_TO}/luminance.md", "manual_luminance", _console("fit luminance")),
    Quote(
        f"{HOW_TO}/luminance.md",
        "manual_luminance",
        _lines("luminance  ", "at least ", "run ./my-luminance.yaml"),
    ),
    *(
        Quote(FLUORESCENT, "manual_matrices", _console(command))
        for command in ("material show", "material compare", "fit mixture")
    ),
    *(
        Quote(FLUORESCENT, "manual_fluorescent", text)
        for text in (
            _lines("365 nm: ", "430 nm: ", "run led_brightness"),
            _line("uv_scale: .*", "run led_brightness"),
            _line(r"yellow: \d dye.*", "process last"),
            _line("daylight: .*", "run validate_illuminants"),
            _line("angular fluorescence: .*", "run angular_fluorescence"),
            _direct_sigma,
        )
    ),
    Quote(f"{VALIDATION}/fluorescence.md", "manual_fluorescent", _direct),
)
