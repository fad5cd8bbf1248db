"""The paragraphs on methods: this run's numbers, and nothing that it did not do."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from labrig.report.methods import Methods, methods
from labrig.report.photographs import Sensor
from labrig.report.report_model import DecayReport
from labrig.report.timing import LatenessStatistics
from labrig.results import FittedDecay

from .made import decay_report, decay_series, fitted, frame, patch

SENSOR = Sensor("Canon EOS 5D Mark II", 1404, 936)
LATE = LatenessStatistics(30, 0.0021, 0.004, 0.0093, "000007.dng")
DECAY = [replace(frame(Path(f"{n:06d}.dng"), n), late_s=0.002) for n in range(1, 31)]
DARK = [
    replace(frame(Path(f"d{n}.dng"), n, "dark", exposure_s), start_time=1.8e9 - 100 + n)
    for n, exposure_s in enumerate((1 / 64, 1 / 64, 1.0, 1.0))
]


@pytest.fixture
def report(tmp_path: Path) -> DecayReport:
    made = decay_report(tmp_path)
    libraries = (("numpy", "2.4.6"), ("scipy", "1.17.1"), ("libraw", "0.22.2"))
    return replace(
        made,
        about=replace(made.about, libraries=libraries),
        frames=(*DARK, *DECAY),
        charge_durations_s=(5400.2,),
    )


def of(report: DecayReport) -> Methods:
    return methods(report, SENSOR, LATE)


def with_fits(report: DecayReport, fits: Sequence[FittedDecay | str]) -> DecayReport:
    first = report.patches[0]
    patches = [replace(first, name=f"{n}", fit=fit) for n, fit in enumerate(fits)]
    return replace(report, patches=tuple(patches))


def test_every_number_is_the_run_s(report: DecayReport) -> None:
    said = of(report)
    for expected in (
        "blue-paint was measured with labrig",
        "The sample was charged under the lamp for 1 h 30 min.",
        "a Canon EOS 5D Mark II at f/4, ISO 400 took 30 RAW frames, each exposed for 1 s, "
        "one every 5 s, from 0.5 s to 146 s after lamp off",
        "2.1 ms later than planned in the median and 9.3 ms at worst",
        "a region of the frame of 702 × 468 pixels, for each of the channels R, G and B",
        "(4 dark frames of 1/64 s to 1 s, taken before the decay)",
    ):
        assert expected in said.recording
    fit = report.patches[0].fit
    assert isinstance(fit, FittedDecay)
    assert f"a flicker of {100 * fit.flicker:.2g} %" in said.analysis
    assert "n = 2, was chosen by the Bayesian information criterion" in said.analysis
    assert "NumPy 2.4.6 [2], SciPy 1.17.1 [3] and LibRaw 0.22.2" in said.analysis
    assert "labrig 1.2.3" in said.analysis
    assert "left out" not in said.plain


def test_a_simulation_is_called_one(report: DecayReport) -> None:
    said = of(replace(report, about=replace(report.about, simulated=True))).recording
    assert "was simulated with labrig" in said
    assert "measured with" not in said


def test_repeats_and_varied_exposures(report: DecayReport) -> None:
    frames = [
        replace(one, unit=f"decay-{1 + n // 15}", exposure_s=0.5 * 2 ** (n % 3))
        for n, one in enumerate(DECAY)
    ]
    said = of(replace(report, frames=tuple(frames), charge_durations_s=(1200.0, 1260.0))).recording
    assert "Before each of 2 decays the sample was charged" in said
    assert "for 20 min to 21 min" in said
    assert "took 15 RAW frames a decay, each exposed for 0.5 s to 2 s" in said
    assert "dark" not in said


def test_what_was_subtracted(report: DecayReport) -> None:
    background = of(replace(report, background=(0.0, 0.0, 0.1, 0.1))).recording
    assert "a dark region of the same frame was subtracted" in background
    assert "dark frames" not in background


def test_frames_left_out_are_counted(report: DecayReport) -> None:
    series = decay_series()
    flagged = replace(series, flag=("clipped", "excluded", "late", *series.flag[3:]))
    said = of(replace(report, patches=(patch(flagged),))).recording
    assert "2 of 30 frames were left out, 1 of them because pixels were saturated." in said


def test_states_that_were_asked_for_were_not_chosen(report: DecayReport) -> None:
    said = of(replace(report, states=2)).analysis
    assert "The number of states was set to 2." in said
    assert "Bayesian" not in said


def test_several_patches(report: DecayReport) -> None:
    fit = fitted(decay_series())
    assert isinstance(fit, FittedDecay)
    one = replace(fit, states=fit.states[:1])
    said = of(with_fits(report, [fit, one, "nothing there"]))
    assert "The samples were charged" in said.recording
    assert "averaged over regions of the frame" in said.recording
    assert "n = 1 or 2 by patch," in said.analysis


def test_without_a_fit_there_is_no_model(report: DecayReport) -> None:
    said = of(with_fits(report, ["nothing there"]))
    assert not said.model
    assert "\\begin{equation}" not in said.plain
    assert "Recording and analysis were done by labrig" in said.plain


def test_one_channel_needs_no_weights(report: DecayReport) -> None:
    said = of(replace(report, patches=(patch(decay_series(channels=("L",))),)))
    assert "weight w_c" not in said.plain
    assert "there are w_c = 1" in said.analysis
    assert "channels" not in said.recording


def test_what_is_not_known_is_not_said(report: DecayReport) -> None:
    about = replace(report.about, libraries=())
    bare = replace(report, about=about, charge_durations_s=(), frames=())
    said = methods(bare, None, None)
    for absent in ("charged", "pixels", "RAW frames", "planned", "dark frames", "NumPy"):
        assert absent not in said.recording + said.analysis
    unfitted = replace(DECAY[0], f_number=None)
    assert "f/" not in of(replace(report, frames=(unfitted,))).recording


def test_the_plain_text_has_the_equation_and_the_citation(report: DecayReport) -> None:
    plain = of(report).plain
    assert plain.count("\\begin{equation}") == plain.count("\\end{equation}") == 1
    assert "doi:10.1111/cgf.13136" in plain
    places = [plain.index(f"\n[{number}] ") for number in (1, 2, 3)]
    assert places == sorted(places)
