"""The campaigns: commands that measure how good labrig is, and what they printed last."""

import os
import resource
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

from tests.acceptance.manual_examples import EXAMPLES
from tests.acceptance.sources import digest

ROOT = Path(__file__).parents[2]
OUTPUTS = Path(__file__).with_name("outputs")


@dataclass(frozen=True)
class Output:
    """Text that a campaign printed, and its circumstances."""

    header: dict[str, str]
    printed: str

    @classmethod
    def of(cls, text: str) -> "Output":
        """Return the output that `text` wrote."""
        lines = text.splitlines()
        n = next((k for k, line in enumerate(lines) if not line.startswith("# ")), len(lines))
        pairs = (line.removeprefix("# ").partition(": ") for line in lines[:n])
        return cls({key: value for key, _, value in pairs}, "\n".join(lines[n:]))

    @property
    def text(self) -> str:
        """Return the text that is kept."""
        header = "".join(f"# {key}: {value}\n" for key, value in self.header.items())
        return f"{header}{self.printed}\n"

    @property
    def date(self) -> str:
        """Return the day of the run, in ISO 8601."""
        return self.header["date"]

    @property
    def cpu_s(self) -> float | None:
        """Return the processor time of the run, or None where it was not recorded."""
        recorded = self.header.get("CPU time")
        return None if recorded is None else float(recorded.removesuffix(" s"))


@dataclass(frozen=True)
class Campaign:
    """A command that measures.

    Attributes
    ----------
    arguments
        What follows `python -m`.
    timed
        Its figures are durations, which depend on the computer.
    """

    name: str
    arguments: tuple[str, ...]
    timed: bool = False

    @property
    def command(self) -> str:
        """Return the command as a person types it."""
        quoted = (f'"{part}"' if " " in part else part for part in self.arguments)
        return " ".join(("python -m", *quoted))

    @property
    def path(self) -> Path:
        """Return the path of the kept output."""
        return OUTPUTS / f"{self.name}.txt"

    @property
    def kept(self) -> Output | None:
        """Return the last output, if the command is still the same."""
        if not self.path.is_file():
            return None
        output = Output.of(self.path.read_text(encoding="utf-8"))
        return output if output.header["command"] == self.command else None

    @property
    def code(self) -> str:
        """Return a digest of the sources that it uses now."""
        return digest(self.arguments[0])

    @property
    def stale(self) -> bool:
        """Return whether the sources have changed since the kept output was printed."""
        return self.kept is None or self.kept.header.get("code") != self.code

    def run(self) -> Output:
        """Run the command and return what it prints."""
        code, began_s = self.code, _children_cpu_s()
        command = [sys.executable, "-m", *self.arguments]
        one_thread = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS")}
        ended = subprocess.run(
            command,
            cwd=ROOT,
            env={**os.environ, **one_thread},
            stdout=subprocess.PIPE,
            text=True,
            check=False,
        )
        header = {
            "command": self.command,
            "labrig": version("labrig"),
            "code": code,
            "date": f"{datetime.now(UTC):%Y-%m-%d}",
            "CPU time": f"{_children_cpu_s() - began_s:.0f} s",
            "exit status": str(ended.returncode),
        }
        # Complaints may name files; where those lay on one computer is of no use to others.
        printed = ended.stdout.rstrip().replace(tempfile.gettempdir(), "TMPDIR")
        return Output(header, printed.replace(str(ROOT), "CLONE"))

    def keep(self, output: Output) -> None:
        """Keep an output as the last."""
        OUTPUTS.mkdir(exist_ok=True)
        self.path.write_text(output.text, encoding="utf-8")


def _children_cpu_s() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _module(name: str, *arguments: str, called: str = "", timed: bool = False) -> Campaign:
    return Campaign(called or name, (f"tests.acceptance.{name}", *arguments), timed)


#: How `mixture_colours` scales its mixtures: words of the output's name, and arguments.
MIXTURE_SCALES = {
    ("integral",): ("--scale", "integral"),
    ("colour",): ("--scale", "colour"),
    ("integral", "skewed"): ("--scale", "integral", "--skewed"),
    ("colour", "skewed"): ("--scale", "colour", "--skewed"),
}
CAMPAIGNS = {
    campaign.name: campaign
    for campaign in (
        _module("coverage_pipeline", "--seeds", "100", "--scenario", "baseline", "all of it"),
        _module(
            "coverage_pipeline",
            *("--seeds", "60", "--scenario", "another", "lamp", "flicker", "steady", "power"),
            called="coverage_pipeline_other_scenarios",
        ),
        _module("coverage_decay_fit", "--seeds", "100"),
        _module("beating_flicker", "--seeds", "100"),
        _module("reference_data"),
        _module("predicted_sigmas", "--days", "32", "--only", "double"),
        _module(
            "predicted_sigmas",
            *("--days", "32", "--only", "blue"),
            called="predicted_sigmas_one_state",
        ),
        _module("excitation_rates", "--seeds", "40"),
        _module("whole_phosphor"),
        _module("reused_calibration"),
        _module("samples_in_turn"),
        _module("fade_pulls", "--seeds", "100"),
        _module("lvf_in_the_room", "--width", "402", "--seeds", "3"),
        _module("spectrum_through_lvf", "40"),
        _module("spectrum_lines", "8"),
        _module("emission_spectra", "3"),
        _module("camera_filters"),
        _module("selected_lights"),
        _module("leds_by_camera", "--seeds", "24"),
        _module("decays_of_all_materials", "--sensor", "384x256"),
        _module("rate_information"),
        *(_module("manual_examples", page, called=f"manual_{page}") for page in EXAMPLES),
        _module("decay_fit_example"),
        _module("veiling_glare"),
        _module("luminance_pulls", "--seeds", "50"),
        _module("luminance_times", "--decays", "100", "--point-fits", "20"),
        _module(
            "luminance_times",
            *("--decays", "40", "--point-fits", "20", "--further"),
            called="luminance_times_further",
        ),
        _module("luminance_times_real"),
        _module("camera_curves"),
        _module("reflectance_pulls", "--seeds", "4"),
        _module("luminance_budget"),
        _module("law_confusion", "--seeds", "100"),
        _module("law_minima", "--seeds", "300"),
        _module("unequal_filling", "--seeds", "40"),
        *(
            _module(
                "coverage_table_sigma", "--broken", "--seeds", "60", "--only", only, called=name
            )
            for name, only in {
                "tables_of_wrong_sigma": "σ times",
                "tables_that_drift": "flicker, ρ",
            }.items()
        ),
        _module(
            "decay_coverage",
            *("--seeds", "200", "--jobs", "1", "--table", "hidden"),
            called="decay_states_that_hide",
        ),
        *(
            _module(
                "interval_coverage",
                *("--seeds", "400", "--only", *only),
                called=f"interval_coverage_{kind}",
            )
            for kind, only in {
                "decay": ("decay",),
                "charge": ("charge",),
                "excitation": ("excitation", "--case", "order"),
                "excitation_faint": ("excitation", "--case", "a tenth"),
            }.items()
        ),
        _module("sao_charge_and_decay"),
        _module("excitation_light"),
        _module("layer_range"),
        _module("trap_models"),
        _module("lightlogger"),
        _module("faults_at_any_moment", "--trials", "450", "--seed", "8"),
        _module(
            "kills_in_every_protocol",
            *("decay", "fade", "blank", "camera_calibration", "saturation", "isotropy"),
        ),
        _module("disk_failures", "--every", "3", "--bytes", "100", "--mounted", "20"),
        _module("devices_vanish", "--every", "40"),
        _module("file_grammars", "--cases", "100000"),
        _module("long_run", "--hours", "24", "--every", "30"),
        _module("mutated_files", "--cases", "10000"),
        _module("edited_journals"),
        _module("hostile_files", "--every", "30"),
        _module("ptp_fuzz", "--cases", "10000", "--seed", "4"),
        _module("serial_fuzz"),
        _module("real_time", "stopped", "--trials", "6", "--seconds", "60"),
        _module("two_labrigs", "--trials", "40"),
        _module("suspended", "--trials", "20"),
        _module("announced_end", "--cuts", "200"),
        _module("reduced_ahead", timed=True),
        _module("lamp_off_however_it_ends", timed=True),
        _module("gphoto2_latency", timed=True),
        _module("least_squares_starts"),
        _module("led_entries"),
        _module("led_matrices", "exact", "per-led", "reflecting", "calibrated"),
        *(
            _module(
                "led_matrices", "exact", "--library", which, called=f"led_matrices_library_{which}"
            )
            for which in ("others", "own", "wrong")
        ),
        _module("led_fluorescence_bench", "--calibrated", called="led_bench_calibrated"),
        _module("led_fluorescence_bench", called="led_bench"),
        _module(
            "led_fluorescence_bench",
            *("--width", "480", "--lamps", "daylight", "halogen"),
            called="led_bench_lamps",
        ),
        _module("tile_noise"),
        *(
            _module("mixture_colours", *arguments, called="_".join(("mixture_colours", *words)))
            for words, arguments in MIXTURE_SCALES.items()
        ),
        _module("wavelength_noise", "--paths", "786432"),
        _module("history_sampling"),
        _module("euler_steps"),
        _module("chart_colours"),
        _module("dark_room"),
        _module("dark_room", "two-states-no-door", called="prediction_beside_photographs"),
        _module("sensor_noise", "--seeds", "100"),
        _module("phosphor_overhead", timed=True),
        _module("fluorescent_room"),
        _module("design_recovery"),
        Campaign(
            "benchmarks",
            ("pytest", "tests/benchmarks", "-n0", "--benchmark-only", "-q", "--no-header"),
            timed=True,
        ),
    )
}
