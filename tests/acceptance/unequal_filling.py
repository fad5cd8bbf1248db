"""States of first order that charges fill unequally, against states of general order: told apart?

    python -m tests.acceptance.unequal_filling [--seeds 100] [--results FILE.jsonl]

Each seed is one `labrig run saturation` in the simulated dark room with a small sensor and several
samples side by side, charged for 10 s, 1 min and 10 min. Two states of first order are excited by
light each by a rate of its own, which the seed draws as it does rates and shares, so that their
mixture changes with the charge and the glow after it falls by another rate; so does that of a state
of general order and of a trap with retrapping. One state of first order is beside them.

Printed are, per sample, how often it is right that an order is told, or none; what is said; and the
verdicts of the test of an order by itself, which is often not decided, since the charges of a
sample that saturates soon hardly differ.
"""

import argparse
import contextlib
import io
import json
import math
import tempfile
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from labrig.cli.exit_codes import guarded
from labrig.foundation.result_warning import ResultWarning
from labrig.process import process_run
from labrig.protocols.saturation.result import PatchSaturation, SaturationResult
from labrig.sim.lamp import BURNING_K, filament_spectrum
from labrig.sim.phosphor import band_cells
from tests.acceptance.decays_of_all_materials import shipped_rig
from tests.acceptance.law_confusion import SPECTRUM, places
from tests.warned import codes

CHARGES = ("10 s", "1 min", "10 min")
ORDERS, RETRAPPINGS, RATIOS = (1.5, 2.0, 3.0), (0.1, 0.5), (2.5, 5.0, 20.0)
#: Geometric mean of two rates, and the range of a single one at lamp off.
MIDDLE_PER_S, RATES_PER_S = 0.035, (0.03, 0.2)
#: Range of the level that a long charge reaches, and of a state's share of the light then.
LEVELS, SHARES = (0.1, 0.9), (0.3, 0.7)
#: Light of a sample at lamp off after a long charge, as Λ k rᵇ: all are about equally bright.
BRIGHTNESS = 0.005
BANDS_NM = (400.0, 437.5, 475.0, 512.5, 550.0, 587.5, 625.0, 662.5, 700.0)
#: Relative excitation rates of the bands.
EXCITED = (0.4, 1.0, 0.08, 0.0, 0.0, 0.0, 0.0, 0.0)
SENSOR = {"width": 96, "height": 72}
NO_ORDER = "no order"
#: Claim of a sample's warnings by their codes, the largest claim first.
CLAIMS = {
    "order": "general-order",
    "rates": "rates-depend-on-charge",
    "no law": "no-kinetic-order",
}


@dataclass(frozen=True)
class Sample:
    """Content of a material file, kinetics in the rig file, and whether its order is the first."""

    material: dict[str, Any]
    kinetics: dict[str, Any] | None
    is_first_order: bool


@dataclass(frozen=True)
class Outcome:
    """Result of one sample; a line of the file of results.

    Attributes
    ----------
    said
        `no order`, or what was warned of: `order`, `rates` that depend on the charge, `no law`.
    verdict
        Verdict of the test of an order.
    shift, shift_sigma
        Its exponent of the rate by the light, and σ.
    """

    sample: str
    seed: int
    is_first_order: bool
    said: str
    verdict: str
    shift: float
    shift_sigma: float
    warnings: list[str]

    @property
    def is_right(self) -> bool:
        """Whether an order is told where there is one, and none where there is none."""
        return (self.said == NO_ORDER) == self.is_first_order


def material(states: Iterable[tuple[float, float, float]]) -> dict[str, Any]:
    """Return a material file with states of a rate, of Λ and of κ under the room's lamp."""
    light = band_cells(BANDS_NM) @ filament_spectrum(BURNING_K)
    kappa_of_one = float(light @ EXCITED) / float(np.linalg.norm(light))
    return {
        "name": "made",
        "kind": "phosphor",
        "bands_nm": list(BANDS_NM),
        "irradiance_norm": {"kind": "vector_length", "value": 1.0},
        "states": [
            {
                "k_r_per_s": rate_per_s,
                "k_e_per_s": [kappa / kappa_of_one * value for value in EXCITED],
                "reradiation": [scale * value for value in SPECTRUM],
            }
            for rate_per_s, scale, kappa in states
        ],
        "provenance": {"source": "made for labrig"},
    }


def first_order(rates_per_s: Iterable[float], rng: np.random.Generator) -> Sample:
    """Return states of first order, each of which a long charge fills to a level of its own."""
    rates = tuple(rates_per_s)
    share = float(rng.uniform(*SHARES))
    parts = (share, 1 - share) if len(rates) > 1 else (1.0,)
    levels = rng.uniform(*LEVELS, len(rates)).tolist()
    states = [
        (k, BRIGHTNESS * part / (k * level), k * level / (1 - level))
        for k, part, level in zip(rates, parts, levels, strict=True)
    ]
    return Sample(material(states), None, True)


def two_states(ratio: float, rng: np.random.Generator) -> Sample:
    """Return two states of first order whose rates are `ratio` apart."""
    middle_per_s = MIDDLE_PER_S * 1.25 ** float(rng.uniform(-1, 1))
    return first_order((middle_per_s * math.sqrt(ratio), middle_per_s / math.sqrt(ratio)), rng)


def general_order(order: float, rng: np.random.Generator) -> Sample:
    """Return one state of a kinetic order."""
    level, rate_per_s = float(rng.uniform(*LEVELS)), _rate_per_s(rng)
    k = rate_per_s / (order * level ** (order - 1))
    state = (k, BRIGHTNESS / (k * level**order), k * level**order / (1 - level))
    return Sample(material([state]), {"model": "general_order", "order": order}, False)


def one_trap(retrapping: float, rng: np.random.Generator) -> Sample:
    """Return one trap with retrapping R, whose emission is k n²/((1 − n) R + n)."""
    level, rate_per_s = float(rng.uniform(*LEVELS)), _rate_per_s(rng)
    places = (1 - level) * retrapping + level
    k = rate_per_s * places / level
    generation = k * level**2 / ((1 - level) * retrapping)
    state = (k, BRIGHTNESS * places / (k * level**2), generation)
    return Sample(material([state]), {"model": "otor", "retrapping": retrapping}, False)


def _rate_per_s(rng: np.random.Generator) -> float:
    slowest, fastest = RATES_PER_S
    return float(slowest * (fastest / slowest) ** rng.uniform())


def samples(seed: int) -> dict[str, Sample]:
    """Return the samples of a seed by name."""
    rng = np.random.default_rng(seed)
    return {
        "one rate": first_order([_rate_per_s(rng)], rng),
        **{f"two rates {ratio:g} apart": two_states(ratio, rng) for ratio in RATIOS},
        **{f"general order {order:g}": general_order(order, rng) for order in ORDERS},
        **{f"one trap, R = {r:g}": one_trap(r, rng) for r in RETRAPPINGS},
    }


def saturation(made: dict[str, Sample], seed: int, folder: Path) -> SaturationResult:
    """Return the result of a saturation run with all samples side by side.

    Raises
    ------
    RuntimeError
        The run failed.
    """
    lie = places(len(made), 3)
    patches = []
    for number, (sample, (region, _)) in enumerate(zip(made.values(), lie, strict=True)):
        (folder / f"{number}.yaml").write_text(yaml.safe_dump(sample.material))
        patch = {"material": f"{number}.yaml", "region": list(region)}
        patches.append(patch | ({} if sample.kinetics is None else {"kinetics": sample.kinetics}))
    rig: dict[str, Any] = shipped_rig("sim", sample=patches, sensor=SENSOR, seed=seed)
    # A lamp that has to warm up would charge for longer than the shortest charge.
    rig["devices"]["lamp"]["warm_up"] = "0 s"
    protocol = {
        "protocol": "saturation",
        "sample": {"name": "samples"},
        "charges": list(CHARGES),
        "patches": {str(number): list(patch) for number, (_, patch) in enumerate(lie)},
    }
    (folder / "rig.yaml").write_text(yaml.safe_dump(rig))
    (folder / "protocol.yaml").write_text(yaml.safe_dump(protocol))
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
        code = guarded(
            ["run", f"{folder}/protocol.yaml", "--rig", f"{folder}/rig.yaml",
             "--runs", f"{folder}/runs", "--no-process", "--yes"]
        )  # fmt: skip
    if code:
        raise RuntimeError(f"seed {seed} ended with {code}: {printed.getvalue()}")
    (run,) = (folder / "runs").iterdir()
    result = process_run(run)
    assert isinstance(result, SaturationResult)
    return result


def outcome(
    name: str, seed: int, sample: Sample, patch: PatchSaturation, warnings: list[ResultWarning]
) -> Outcome:
    """Return the claim of a sample's warnings."""
    said = next((claim for claim, code in CLAIMS.items() if code in codes(warnings)), NO_ORDER)
    test = patch.order
    return Outcome(
        sample=name,
        seed=seed,
        is_first_order=sample.is_first_order,
        said=said,
        verdict=test.verdict if test else "none",
        shift=test.shift.value if test else math.nan,
        shift_sigma=test.shift.sigma if test else math.nan,
        warnings=codes(warnings),
    )


def report(outcomes: list[Outcome]) -> Iterator[str]:
    """Yield a line per sample."""
    for name in dict.fromkeys(each.sample for each in outcomes):
        own = [each for each in outcomes if each.sample == name]
        said, verdicts = (
            Counter(values)
            for values in zip(*((each.said, each.verdict) for each in own), strict=True)
        )
        right = sum(each.is_right for each in own)
        yield (
            f"{name:22s} {len(own):3d} seeds: right {100 * right / len(own):5.1f} %; said: "
            + ", ".join(f"{what} {n}" for what, n in said.most_common())
            + "; test: "
            + ", ".join(f"{what} {n}" for what, n in verdicts.most_common())
        )


def main() -> None:
    """Make what is missing, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--results", type=Path, help="file of results, with a line per sample")
    asked = parser.parse_args()
    kept = asked.results is not None and asked.results.is_file()
    lines = asked.results.read_text(encoding="utf-8").splitlines() if kept else []
    outcomes = [Outcome(**json.loads(line)) for line in lines]
    done = {each.seed for each in outcomes}
    for seed in sorted(set(range(1, asked.seeds + 1)) - done):
        made = samples(seed)
        with tempfile.TemporaryDirectory() as folder:
            result = saturation(made, seed, Path(folder))
        for number, (name, sample) in enumerate(made.items()):
            own = [
                warning
                for warning in result.warnings
                if warning.subject.split(": ")[0] == str(number)
            ]
            outcomes.append(outcome(name, seed, sample, result.patches[str(number)], own))
            if asked.results is not None:
                with asked.results.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(asdict(outcomes[-1])) + "\n")
    print(*report(outcomes), sep="\n")


if __name__ == "__main__":
    main()
