"""Which law of decay is taken for which, from the simulated dark room to the fit, over many seeds.

    python -m tests.acceptance.law_confusion [--seeds 100] [--results FILE.jsonl]

Each seed is three runs of the command line in a simulated dark room with a small sensor and several
samples side by side, by the default decay protocol; each sample is then fitted as if it were alone.
In the first run are sums of two exponentials, states of general order and traps with retrapping,
with rates and shares that the seed draws, at a signal-to-noise ratio of about 300; in the second
one Table 1 of Nalbach et al., and in a third one the shipped double exponentials, all of which are
of first order. Lines that are in the file of results already are not made again.

Printed are, per sample, how often the law is right (at least 90 %), how often it is wrong without a
word (at most 2 %): another law is right, no warning says so, and the signal within three times the
measured time is wrong by more than 3 σ. Of materials: how often the rates lie within 3 σ.
"""

import argparse
import contextlib
import io
import json
import math
import tempfile
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from labrig.analyse import Overrides, fit_series
from labrig.analyse.frames import intact_frames
from labrig.cli.exit_codes import guarded
from labrig.fit import DecayFit
from labrig.foundation import resources
from labrig.foundation.region import Region
from labrig.material import read_material
from labrig.record import read_run
from labrig.reduce import reduce_patches
from labrig.results import FORECAST_SPANS, Series
from tests.acceptance.decays_of_all_materials import shipped_rig
from tests.fit import truths
from tests.warned import codes

#: Level of a fully charged sample.
CHARGE = 0.5
#: Range of the rate at lamp off of a single state: that of Table 1.
RATES_PER_S = 0.03, 0.2
#: Geometric mean of two rates, and by how much it varies.
MIDDLE_PER_S, VARIATION = 0.035, 1.25
#: Share of the faster of two states in the light at lamp off.
SHARES = 0.3, 0.7
#: Light of a sample at lamp off, as Λ k r: all are about equally bright.
BRIGHTNESS = 0.005
SPECTRUM = (0.05, 0.4, 1.0, 1.0, 0.4, 0.05, 0.0, 0.0)
SENSOR = {"width": 96, "height": 48}
MATERIALS_SENSOR = {"width": 96, "height": 64}
#: Errors in σ from which a number is wrong, and times of predictions, in measured times.
WRONG_SIGMAS = 3.0
PREDICTED_AT = np.array([0.25, 0.5, 1.0, 1.5, 2.0, FORECAST_SPANS])
ORDERS, RETRAPPINGS, RATIOS = (1.5, 2.0, 3.0), (0.1, 0.5), (2.5, 5.0, 20.0)


@dataclass(frozen=True)
class Sample:
    """A sample in the room and what is known of it.

    Attributes
    ----------
    material
        Content of its material file, or the name of a shipped one.
    kinetics
        Its `kinetics` in a rig file; None: of first order.
    rates_per_s
        Rates of its exponentials, the fastest first; empty if it has none.
    right
        Names of the laws that are right.
    decay
        Its light over that at lamp off; None if only its rates are looked at.
    """

    material: dict[str, Any] | str
    kinetics: dict[str, Any] | None
    rates_per_s: tuple[float, ...]
    right: tuple[str, ...]
    decay: truths.Decay | None = None


@dataclass(frozen=True)
class Outcome:
    """What came out for one sample; a line of the file of results.

    Attributes
    ----------
    sample, seed
        Sample and seed.
    law
        Law that was taken, with the number of its states if it is exponentials.
    is_right, is_tie_said
        Whether it is the right one, and whether a warning names another that is as good.
    rate_pulls, signal_pulls
        Errors of rates, where their number is right, and of predicted signals, in σ.
    signal_to_noise
        That of the first frame in its brightest channel, without flicker.
    warnings
        Warnings of the fit.
    """

    sample: str
    seed: int
    law: str
    is_right: bool
    is_tie_said: bool
    rate_pulls: list[float]
    signal_pulls: list[float]
    signal_to_noise: float
    warnings: list[str]

    @property
    def is_silently_wrong(self) -> bool:
        """Whether law and predictions are wrong, and nothing says so."""
        worst = max(map(abs, (*self.rate_pulls, *self.signal_pulls)), default=0.0)
        return not self.is_right and not self.is_tie_said and worst > WRONG_SIGMAS


def material(name: str, states: Iterable[tuple[float, float]]) -> dict[str, Any]:
    """Return a material file with states of a rate in 1/s and Λ."""
    return {
        "name": name,
        "kind": "phosphor",
        "bands_nm": [400.0, 437.5, 475.0, 512.5, 550.0, 587.5, 625.0, 662.5, 700.0],
        "irradiance_norm": {"kind": "vector_length", "value": 1.0},
        "states": [
            {
                "k_r_per_s": rate_per_s,
                "k_e_per_s": [0.02, 0.05, 0.004, 0.0, 0.0, 0.0, 0.0, 0.0],
                "reradiation": [scale * value for value in SPECTRUM],
            }
            for rate_per_s, scale in states
        ],
        "provenance": {"source": "made for labrig"},
    }


def two_states(ratio: float, rng: np.random.Generator) -> Sample:
    """Return two exponentials whose rates are `ratio` apart."""
    middle_per_s = MIDDLE_PER_S * VARIATION ** float(rng.uniform(-1, 1))
    rates = middle_per_s * math.sqrt(ratio), middle_per_s / math.sqrt(ratio)
    share = float(rng.uniform(*SHARES))
    parts = share, 1 - share
    states = [(k, BRIGHTNESS * part / (k * CHARGE)) for k, part in zip(rates, parts, strict=True)]
    decay = truths.exponentials(*zip(rates, parts, strict=True))
    return Sample(material("double", states), None, rates, ("exponentials",), decay)


def general_order(order: float, rng: np.random.Generator) -> Sample:
    """Return one state of a kinetic order, by its rate at lamp off."""
    rate_per_s = _rate_per_s(rng)
    k = rate_per_s / (order * CHARGE ** (order - 1))
    tau_s = 1 / ((order - 1) * k * CHARGE ** (order - 1))
    return Sample(
        material("order", [(k, BRIGHTNESS / (k * CHARGE**order))]),
        {"model": "general_order", "order": order},
        (),
        # The second order is both.
        ("becquerel", "otor") if order == 2 else ("becquerel",),
        truths.power_law(tau_s, order / (order - 1)),
    )


def one_trap(retrapping: float, rng: np.random.Generator) -> Sample:
    """Return one trap with retrapping, by the rate of its level at lamp off."""
    rate_per_s = _rate_per_s(rng)
    places = retrapping + (1 - retrapping) * CHARGE
    k = rate_per_s * places / CHARGE
    return Sample(
        material("trap", [(k, BRIGHTNESS * places / (k * CHARGE**2))]),
        {"model": "otor", "retrapping": retrapping},
        (),
        ("otor", "becquerel"),
        _trap(k, retrapping),
    )


def _rate_per_s(rng: np.random.Generator) -> float:
    slowest, fastest = RATES_PER_S
    return float(slowest * (fastest / slowest) ** rng.uniform())


def _trap(k: float, retrapping: float) -> truths.Decay:
    """Return dn/dt = −k n²/((1 − R) n + R) over that at lamp off, by time as a function of n."""
    level = CHARGE * np.geomspace(1, 1e-4, 40_000)
    time_s = (retrapping * (1 / level - 1 / CHARGE) - (1 - retrapping) * np.log(level / CHARGE)) / k
    light = level**2 / ((1 - retrapping) * level + retrapping)
    return lambda t: np.interp(t, time_s, light / light[0])


def laws(seed: int) -> dict[str, Sample]:
    """Return the samples of the table of laws."""
    rng = np.random.default_rng(seed)
    return {
        **{f"two rates {ratio:g} apart": two_states(ratio, rng) for ratio in RATIOS},
        **{f"general order {order:g}": general_order(order, rng) for order in ORDERS},
        **{f"one trap, R = {r:g}": one_trap(r, rng) for r in RETRAPPINGS},
    }


def shipped(names: Iterable[str]) -> dict[str, Sample]:
    """Return shipped materials, of first order."""
    return {
        name: Sample(name, None, _rates_per_s(name), ("exponentials",)) for name in sorted(names)
    }


def _rates_per_s(name: str) -> tuple[float, ...]:
    return tuple(sorted((state.k_r_per_s for state in read_material(name).states), reverse=True))


def table_1(_: int) -> dict[str, Sample]:
    """Return the materials of the paper's Table 1."""
    rig = shipped_rig("sim-eleven")
    return shipped(patch["material"] for patch in rig["simulation"]["sample"])  # type: ignore[index]


def doubles(_: int) -> dict[str, Sample]:
    """Return the shipped double exponentials."""
    return shipped(name for name in resources.names("config/materials") if name[:6] == "double")


@dataclass(frozen=True)
class Table:
    """A run: samples of a seed, side by side in rows of so many, before a sensor."""

    samples: Callable[[int], dict[str, Sample]]
    per_row: int
    sensor: Mapping[str, int]


TABLES = {
    "laws": Table(laws, 4, SENSOR),
    "Table 1": Table(table_1, 4, MATERIALS_SENSOR),
    "doubles": Table(doubles, 3, MATERIALS_SENSOR),
}


def places(n: int, per_row: int) -> list[tuple[Region, Region]]:
    """Return where n samples lie, and what of them is measured."""
    n_rows = -(-n // per_row)
    width, height = 1 / per_row, 1 / n_rows
    corners = [(index % per_row * width, index // per_row * height) for index in range(n)]
    return [
        (
            (x + 0.05 * width, y + 0.05 * height, 0.9 * width, 0.9 * height),
            (x + 0.25 * width, y + 0.25 * height, 0.5 * width, 0.5 * height),
        )
        for x, y in corners
    ]


def series(table: Table, samples: Mapping[str, Sample], seed: int) -> dict[str, Series]:
    """Return the series of every sample of one run.

    Raises
    ------
    RuntimeError
        The run failed.
    """
    lie = places(len(samples), table.per_row)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        patches = []
        for number, (sample, (region, _)) in enumerate(zip(samples.values(), lie, strict=True)):
            file: Any = sample.material
            if not isinstance(file, str):
                (folder / f"{number}.yaml").write_text(yaml.safe_dump(file))
                file = f"{number}.yaml"
            patch = {"material": file, "region": list(region), "kinetics": sample.kinetics}
            patches.append(patch | ({} if sample.decay is None else {"initial_charge": CHARGE}))
        rig = shipped_rig("sim", sample=patches, sensor=dict(table.sensor), seed=seed)
        measured = {str(number): patch for number, (_, patch) in enumerate(lie)}
        protocol = {"protocol": "decay", "sample": {"name": "samples"}}
        protocol["patches"] = {key: list(patch) for key, patch in measured.items()}
        (folder / "rig.yaml").write_text(yaml.safe_dump(rig))
        (folder / "protocol.yaml").write_text(yaml.safe_dump(protocol))
        said = io.StringIO()
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            code = guarded(
                ["run", f"{folder}/protocol.yaml", "--rig", f"{folder}/rig.yaml",
                 "--runs", f"{folder}/runs", "--no-process"]
            )  # fmt: skip
        if code:
            raise RuntimeError(f"seed {seed} ended with {code}: {said.getvalue()}")
        (run,) = map(read_run, (folder / "runs").iterdir())
        frames = intact_frames(run, Overrides())
        reduced = reduce_patches(frames.decay, measured, frames.dark)
    return dict(zip(samples, (reduced[key] for key in measured), strict=True))


def outcome(name: str, seed: int, sample: Sample, seen: Series) -> Outcome:
    """Return what the fit of a series makes of a sample."""
    fit = fit_series(seen)
    states = fit.n_states == len(sample.rates_per_s)
    brightest = seen.values.max(axis=0).argmax()
    return Outcome(
        sample=name,
        seed=seed,
        law=f"{fit.n_states} exponentials" if fit.law == "exponentials" else fit.law,
        is_right=fit.law in sample.right and (states or not sample.rates_per_s),
        is_tie_said="laws-tied" in codes(fit.warnings),
        rate_pulls=[
            (state.k_r_per_s - k) / state.k_r_per_s_sigma
            for state, k in zip(fit.states, sample.rates_per_s, strict=False)
        ]
        if states
        else [],
        signal_pulls=[] if sample.decay is None else signal_pulls(fit, sample.decay, seen),
        signal_to_noise=float(seen.values[0, brightest] / seen.sigma[0, brightest]),
        warnings=codes(fit.warnings),
    )


def signal_pulls(fit: DecayFit, decay: truths.Decay, seen: Series) -> list[float]:
    """Return the errors of the signal that the law taken predicts, in σ.

    The true signal is in proportion to `decay`, by a factor that all frames tell to about 0.1 %.
    """
    brightest = fit.brightest
    true = truths.exposed(decay, seen.t_s, seen.exposure_s)
    fitted, _ = fit.signal(seen.t_s, seen.exposure_s)
    weight = 1 / (seen.sigma[:, brightest] ** 2 + (0.007 * fitted) ** 2)
    values = seen.values[:, brightest] - fit.predict(seen.t_s, seen.exposure_s)[:, brightest]
    scale = float(weight @ (true * (values + fitted)) / (weight @ true**2))
    at_s = PREDICTED_AT * fit.measured_until_s
    predicted, variance = fit.signal(at_s, np.zeros_like(at_s))
    return list((predicted - scale * decay(at_s)) / np.sqrt(variance))


def made(results: Path) -> list[Outcome]:
    """Return what is in a file of results."""
    if not results.is_file():
        return []
    lines = results.read_text(encoding="utf-8").splitlines()
    return [Outcome(**json.loads(line)) for line in lines]


def report(outcomes: list[Outcome]) -> Iterator[str]:
    """Return a line per sample."""
    for name in dict.fromkeys(each.sample for each in outcomes):
        own = [each for each in outcomes if each.sample == name]
        right = 100 * np.mean([each.is_right for each in own])
        silent = 100 * np.mean([each.is_silently_wrong for each in own])
        told = 100 * np.mean([each.is_tie_said for each in own])
        pulls = np.array([pull for each in own for pull in each.rate_pulls])
        rates = (
            f"rates: {100 * np.mean(np.abs(pulls) > WRONG_SIGMAS):.1f} % beyond 3 σ, rms "
            f"{np.sqrt(np.mean(pulls**2)):.2f}, furthest {np.abs(pulls).max():.1f}; "
            if pulls.size
            else ""
        )
        taken = Counter(each.law for each in own)
        yield (
            f"{name:22s} {len(own):3d} seeds, signal to noise "
            f"{np.median([each.signal_to_noise for each in own]):4.0f}: right {right:5.1f} %, "
            f"silently wrong {silent:4.1f} %, tie said {told:4.1f} %; {rates}"
            + ", ".join(f"{law} {n}" for law, n in taken.most_common())
        )


def main() -> None:
    """Make what is missing, and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--results", type=Path, help="file of results, with a line per fit")
    parser.add_argument("--table", nargs="*", default=list(TABLES))
    asked = parser.parse_args()
    outcomes = [] if asked.results is None else made(asked.results)
    done = {(each.sample, each.seed) for each in outcomes}
    for seed in range(1, asked.seeds + 1):
        for table in (TABLES[name] for name in asked.table):
            samples = table.samples(seed)
            if all((name, seed) in done for name in samples):
                continue
            seen = series(table, samples, seed)
            new = [outcome(name, seed, samples[name], seen[name]) for name in samples]
            outcomes += new
            if asked.results is not None:
                with asked.results.open("a", encoding="utf-8") as file:
                    file.writelines(json.dumps(asdict(each)) + "\n" for each in new)
    print(*report(outcomes), sep="\n")


if __name__ == "__main__":
    main()
