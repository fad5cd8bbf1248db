"""Rooms that break one assumption each: is any result wrong without a word?

    python -m tests.acceptance.wrong_assumptions [--seeds 30] [--case NAME ...] [--clean 200]
        [--jobs 1] [--keep FOLDER] [--results FILE]

Every run is `labrig run decay` in a simulated room of `wrong_rooms`, from the lamp to fit and
warnings. Its rates, amplitudes and signals, from the first frame to three times the last, are
compared with the truth of the room that was measured; where states have no rates, signals alone.
Rooms of `wrong_charging` are measured by a short `labrig run excitation`, and its rates, excitation
rates and the level that was reached are compared. Wrong is a run of which one of these lies beyond
3 σ; of three times the last time the bracket of all laws counts, too.

The table has, for each case: runs; those that are wrong; those that are wrong without a warning, of
which each error is within 3 σ of what the result states that the room's drift changes, the
temperature not being recorded, or the sample's fast state, which goes unseen; those that are wrong
and silent (goal: at most 1 of 30); those with a warning; those that were refused; the median of the
furthest error in σ and in %, and how often which warning came. The goal for clean runs of all
materials is at most 2 % with a warning. Runs that are kept are not made again, nor are those judged
again that stand in the results, a line of JSON each.
"""

import argparse
import contextlib
import io
import json
import re
import shutil
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

from labrig import sim
from labrig.calibration import CAMERA_KIND
from labrig.cli.exit_codes import guarded
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import LabrigError
from labrig.foundation.region import region_pixels
from labrig.foundation.result_warning import ResultWarning, as_warnings
from labrig.process import process_run
from labrig.protocols.decay.result import DecayResult
from labrig.results import EXPONENTIALS, DecayPatch, DecayState, FittedDecay, RunResult
from labrig.sim.optics import CHANNELS, vignetting
from labrig.sim.truth import TrueState, Truth
from tests.acceptance.wrong_charging import CHARGES, Charging
from tests.acceptance.wrong_rooms import BESIDE, CLEAN, DECAYS, Case

#: Deviation in σ from which a result is wrong.
WRONG_SIGMAS = 3.0
#: Start of the exposures of a second, after lamp off, in which signals are compared; the last one
#: ends three times as late as the last frame.
SIGNALS_S = (0.5, 5.0, 20.0, 60.0, 150.0, 520.0)
EXPOSURE_S = 1.0
#: Time at which signals are made equal to the truth where they have no scale.
SCALED_AT_S = 20.0
LAST_FRAME_S = 180.0
#: Part of the first signal that counts as darkness: nobody tells a tenth of it from none.
DARKNESS = 1e-4
#: Ratio of two rates beyond which they are not those of the same state.
SAME_RATE = 3.0


AnyCase = Case | Charging
#: Error, σ and truth.
Error = tuple[float, float, float]


@dataclass(frozen=True)
class Judged:
    """One run of a case.

    Attributes
    ----------
    pulls
        (found − true)/σ of each result; of signals that laws bracket, 0.
    percent
        Error of each result in % of the truth.
    warnings
        Warnings of the run and of its result.
    failure
        Why there is no result; empty if there is one.
    stated
        What the broken assumption changes by what the result states, in σ, ≥ 0.
    """

    case: str
    seed: int
    material: str
    pulls: dict[str, float]
    percent: dict[str, float]
    warnings: tuple[ResultWarning, ...]
    failure: str = ""
    stated: dict[str, float] = field(default_factory=dict)

    @property
    def furthest(self) -> str:
        """Return the name of the result that is furthest off in σ."""
        return max(self.pulls, key=lambda name: abs(self.pulls[name]), default="")

    @property
    def is_wrong(self) -> bool:
        """Whether a result is beyond what σ says."""
        return any(abs(pull) > WRONG_SIGMAS for pull in self.pulls.values())

    @property
    def is_unwarned(self) -> bool:
        """Whether a result is wrong without a warning."""
        return self.is_wrong and not self.warnings and not self.failure

    @property
    def is_silent(self) -> bool:
        """Whether a result is wrong and nothing was said, not even what may change it."""
        return self.is_unwarned and any(
            abs(pull) > WRONG_SIGMAS + self.stated.get(name, 0.0)
            for name, pull in self.pulls.items()
        )


def record(case: AnyCase, seed: int, folder: Path) -> None:
    """Make a run in a folder, with the truth of its room beside it.

    Raises
    ------
    RuntimeError
        The run ended early.
    """
    if isinstance(case, Case) and case.is_calibrated:
        case.write_calibration(seed, folder)
        _run(folder, "calibration", "--yes")
        (made,) = (folder / "calibration").glob("*/result/camera.yaml")
        made.rename(folder / CAMERA_KIND.file_name)
        shutil.rmtree(folder / "calibration")
    case.write(seed, folder)
    rooms: list[sim.OpenRoom] = []
    open_room = sim.open_room

    @contextlib.contextmanager
    def remembered(*arguments: Any, **keys: Any) -> Iterator[sim.OpenRoom]:
        with open_room(*arguments, **keys) as room:
            rooms.append(room)
            yield room

    with mock.patch.object(sim, "open_room", remembered):
        said = _run(folder, "runs", "--no-process", "--yes")
    room, truth = rooms[-1].room, rooms[-1].room.truth()
    assert truth.lamp_off_s is not None
    rooms[-1].clock.spend(4 * LAST_FRAME_S)
    signals = [room.true_dn_per_s(truth.lamp_off_s + t_s, EXPOSURE_S).tolist() for t_s in SIGNALS_S]
    warnings = re.findall("^warning: (.*)$", said, re.M)
    (folder / "seen.json").write_text(json.dumps({"signals": signals, "warnings": warnings}))
    truth.write(folder / "truth.json")


def _run(folder: Path, runs: str, *options: str) -> str:
    """Run the protocol in a folder, and return what was said.

    Raises
    ------
    RuntimeError
        The run ended early.
    """
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        code = guarded(
            ["run", f"{folder}/protocol.yaml", "--rig", f"{folder}/rig.yaml",
             "--runs", f"{folder}/{runs}", *options]
        )  # fmt: skip
    if code:
        raise RuntimeError(f"{folder} ended with {code}: {said.getvalue()[-500:]}")
    return said.getvalue()


def judged(case: AnyCase, keep: Path | None, seed: int) -> Judged:
    """Return the judgement of a run, which is kept in a folder if there is one for it."""
    if keep is None:
        with tempfile.TemporaryDirectory() as made:
            record(case, seed, Path(made))
            return judge(case, seed, Path(made))
    folder = keep / case.name.replace(" ", "-").replace("/", "-per-") / str(seed)
    if not (folder / "truth.json").is_file():
        shutil.rmtree(folder, ignore_errors=True)  # of a seed that was interrupted
        folder.mkdir(parents=True)
        record(case, seed, folder)
    return judge(case, seed, folder)


def judge(case: AnyCase, seed: int, folder: Path) -> Judged:
    """Return how far the results of a run are from the truth beside it."""
    truth = Truth.model_validate_json((folder / "truth.json").read_text())
    seen = json.loads((folder / "seen.json").read_text())
    (run,) = (folder / "runs").iterdir()
    about = (case.name, seed, case.material(seed))
    try:
        result = process_run(run)
    except LabrigError as error:
        return Judged(*about, {}, {}, as_warnings(seen["warnings"]), str(error))
    errors = (
        dict(case.errors(result, truth))
        if isinstance(case, Charging)
        else _decay_errors(case, result, truth, np.array(seen["signals"]))
    )
    pulls = {name: off / sigma for name, (off, sigma, _) in errors.items()}
    percent = {name: 100 * off / true for name, (off, _, true) in errors.items()}
    stated = dict(_stated(case, result, truth)) if isinstance(case, Case) else {}
    warnings = (*as_warnings(seen["warnings"]), *result.warnings)
    return Judged(*about, pulls, percent, warnings, "", stated)


def _stated(case: Case, result: RunResult, truth: Truth) -> Iterator[tuple[str, float]]:
    """Return what the broken assumption changes by what the result states, in σ, by name."""
    assert isinstance(result, DecayResult)
    for patch in result.patches.values():
        if patch.fit is None or len(result.patches) > 1:
            continue
        changes = np.zeros((patch.fit.n_states, 2))
        if patch.drift_effect is not None:
            changes += np.abs(case.drift_k_per_hour * patch.drift_effect)
        if case.hidden is not None and (unseen := patch.fit.unseen_state) is not None:
            changes += np.abs(np.transpose([unseen.rate_changes, unseen.amplitude_changes]))
        for state, (rate, amplitude) in zip(patch.fit.states, changes, strict=True):
            true = min(truth.patches[0].states, key=lambda each: _apart(state, each))
            yield f"k {true.k_r_per_s:.2g}", rate * state.k_r_per_s / state.k_r_per_s_sigma
            yield f"a {true.k_r_per_s:.2g}", amplitude * state.amplitude / state.amplitude_sigma


def _decay_errors(
    case: Case, result: RunResult, truth: Truth, signals: FloatArray
) -> dict[str, Error]:
    """Return error, σ and truth of all results of a decay; `signals` is (times, patches, 3)."""
    assert isinstance(result, DecayResult)
    errors: dict[str, Error] = {}
    for name, patch in result.patches.items():
        if patch.fit is None:
            continue
        number = list(BESIDE).index(name) if case.with_neighbour else 0
        of_patch = signals[:, number]
        lens = 1.0 if case.is_calibrated else _seen_by_the_lens(case, patch)
        if not case.has_scale:
            lens = _scale(patch.fit, of_patch)
        found = dict(_signal_errors(patch.fit, lens * of_patch))
        if case.has_rates and patch.fit.law == EXPONENTIALS:
            found |= _state_errors(patch.fit, truth, number, lens)
        prefix = f"{name} " if len(result.patches) > 1 else ""
        errors |= {f"{prefix}{key}": error for key, error in found.items()}
    return errors


def _seen_by_the_lens(case: Case, patch: DecayPatch) -> float:
    """Return the mean of the lens's vignetting over a patch."""
    assert patch.region is not None
    sensor = case.sensor
    x, y, wide, high = region_pixels(patch.region, sensor["width"], sensor["height"])
    falloff = vignetting(sensor["height"], sensor["width"])
    return float(falloff[y : y + high, x : x + wide].mean())


def _scale(fit: FittedDecay, signals: FloatArray) -> float:
    """Return the signal found over the true one at a time at which both are well known."""
    found = fit.forecast(SCALED_AT_S, EXPOSURE_S).value[0]
    true = signals[SIGNALS_S.index(SCALED_AT_S), CHANNELS.index(fit.brightest_channel)]
    return float(found / true)


def _signal_errors(fit: FittedDecay, signals: FloatArray) -> Iterator[tuple[str, Error]]:
    """Return error, σ and truth of the signals in the brightest channel, by name."""
    forecast = fit.forecast(SIGNALS_S, EXPOSURE_S)
    true = signals[:, CHANNELS.index(fit.brightest_channel)]
    sigma = np.hypot(forecast.sigma, DARKNESS * true[0])
    is_bracketed = (forecast.low <= true) & (true <= forecast.high)
    is_bracketed &= np.array(SIGNALS_S) > LAST_FRAME_S
    off = np.where(is_bracketed, 0.0, forecast.value - true)
    for t_s, error in zip(SIGNALS_S, zip(off, sigma, true, strict=True), strict=True):
        yield f"{t_s:g} s", error


def _state_errors(fit: FittedDecay, truth: Truth, number: int, lens: float) -> dict[str, Error]:
    """Return error, σ and truth of rates and amplitudes; of a state that is not there, infinity."""
    channel = CHANNELS.index(fit.brightest_channel)
    left = list(truth.patches[number].states)
    errors: dict[str, Error] = {}
    for state in fit.states:
        nearest = min(left, key=lambda each: _apart(state, each), default=None)
        if nearest is None or _apart(state, nearest) > np.log(SAME_RATE):
            errors[f"state of {state.k_r_per_s:.2g} /s"] = (np.inf, 1.0, 1.0)
            continue
        left.remove(nearest)
        assert nearest.amplitude_dn_per_s is not None
        amplitude = lens * nearest.amplitude_dn_per_s[channel]
        k = nearest.k_r_per_s
        errors[f"k {k:.2g}"] = (state.k_r_per_s - k, state.k_r_per_s_sigma, k)
        errors[f"a {k:.2g}"] = (state.amplitude - amplitude, state.amplitude_sigma, amplitude)
    return errors


def _apart(found: DecayState, true: TrueState) -> float:
    return float(abs(np.log(found.k_r_per_s / true.k_r_per_s)))


def line(name: str, runs: Sequence[Judged]) -> str:
    """Return the line of a case."""
    done = [one for one in runs if one.pulls]
    furthest = [abs(one.pulls[one.furthest]) for one in done] or [np.nan]
    percent = [abs(one.percent[one.furthest]) for one in done] or [np.nan]
    said = Counter(_kind(warning) for one in runs for warning in one.warnings)
    failed = sum(bool(one.failure) for one in runs)
    return (
        f"{name:28}{len(runs):5}{sum(one.is_wrong for one in runs):6}"
        f"{sum(one.is_unwarned and not one.is_silent for one in runs):7}"
        f"{sum(one.is_silent for one in runs):7}{sum(bool(one.warnings) for one in runs):7}"
        f"{failed:8}{np.median(furthest):8.1f}{np.median(percent):9.2g}  "
        + "; ".join(f"{count} {text}" for text, count in said.most_common(3))
    )


HEAD = (
    f"{'case':28}{'runs':>5}{'wrong':>6}{'stated':>7}{'silent':>7}{'warned':>7}{'refused':>8}"
    f"{'/ σ':>8}{'/ %':>9}  warnings"
)


def _kind(warning: ResultWarning) -> str:
    """Return the code of a warning; of a message of the run its text without numbers, cut off."""
    text = re.sub(r"[-+\d.,]+(e[-+]?\d+)?", "#", warning.sentence.partition(": ")[0])
    return warning.code or text[:60]


def results(path: Path | None) -> list[Judged]:
    """Return what was judged before."""
    if path is None or not path.is_file():
        return []
    return [Judged(**json.loads(text)) for text in path.read_text().splitlines()]


def main() -> None:
    """Run what is asked, print a line for each case as it comes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=30)
    parser.add_argument("--case", nargs="*", help="all")
    parser.add_argument("--clean", type=int, default=200)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--results", type=Path)
    asked = parser.parse_args()
    known = results(asked.results)
    every: list[AnyCase] = [*DECAYS, *CHARGES]
    cases = [case for case in every if not asked.case or case.name in asked.case]
    wanted = [(case, asked.seeds) for case in cases] + [(CLEAN, asked.clean)]
    print(HEAD)
    with ProcessPoolExecutor(asked.jobs) as pool:
        for case, count in wanted:
            done = [one for one in known if one.case == case.name and one.seed <= count]
            missing = sorted(set(range(1, count + 1)) - {one.seed for one in done})
            for one in pool.map(partial(judged, case, asked.keep), missing):
                done.append(one)
                if asked.results is not None:
                    with asked.results.open("a") as file:
                        file.write(json.dumps(asdict(one)) + "\n")
            if done:
                print(line(case.name, done), flush=True)


if __name__ == "__main__":
    main()
