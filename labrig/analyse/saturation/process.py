"""From the decays of a saturation run: is r(0) = 1, and do rates depend on the charge?"""

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from labrig.analyse.clean import cleaned
from labrig.analyse.part import Part, StageResult
from labrig.analyse.saturation.found import Saturation
from labrig.analyse.saturation.level import Level, level
from labrig.analyse.saturation.shared_rates import RatesTest, compare_rates, curve, flicker_dof
from labrig.analyse.saturation.telling import lines, section, verdicts
from labrig.analyse.series_fit import fit_series
from labrig.analyse.this_camera import insist_on_this_camera
from labrig.analyse.timed_frames import intact_frames, timing_warnings
from labrig.errors import DataError
from labrig.record import RunRecord
from labrig.record.history import charges_s
from labrig.reduce import reduce_patches
from labrig.results import Series

FloatArray = NDArray[np.float64]

#: Lights of a saturation run, as its units are called.
FULL, WEAKER = "full", "weaker"


def process(part: Part) -> StageResult:
    """Plateaus compared, levels where there were two lights, rates shared and not.

    Raises
    ------
    DataError
        Fewer than two decays under the full light, or frames are damaged.
    FitError
        The decays do not allow a fit.
    """
    frames, stray = cleaned(intact_frames(part.run, part.choices), part.inputs.blank)
    insist_on_this_camera(part.inputs.camera, part.run, part.run.frames("decay"))
    patches = part.choices.patches(part.protocol)
    series = reduce_patches(frames.decay, patches, frames.dark, camera=part.inputs.camera)
    charges = _charges_s(part.run)
    asked = part.choices.states or (
        None if part.protocol.states == "auto" else part.protocol.states
    )
    found = {name: _saturation(one, charges, part, asked) for name, one in series.items()}
    _write(part.folder / "saturation.csv", found)
    several = len(found) > 1
    return StageResult(
        known=part.inputs,
        sections=tuple(section(name, one, part.protocol.weaker) for name, one in found.items()),
        lines=tuple(
            f"{name}: {line}" if several else line
            for name, one in found.items()
            for line in lines(one)
        ),
        warnings=(
            *timing_warnings(part.run),
            *stray,
            *(
                f"{name}: {line}" if several else line
                for name, one in found.items()
                for line in verdicts(one)
            ),
        ),
    )


def _charges_s(run: RunRecord) -> dict[str, float]:
    """How long the lamp really shone before the decay of each unit."""
    units = [
        unit
        for unit, attempt in run.completed().items()
        if any(frame.purpose == "decay" for frame in attempt.frames)
    ]
    return dict(zip(units, charges_s(run), strict=True))


def _saturation(
    series: Series, charges: Mapping[str, float], part: Part, states: int | None
) -> Saturation:
    decays = {one.unit[0]: one for one in series.by_unit()}
    by_light = {
        light: [unit for unit in decays if unit.startswith(f"{light}-")] for light in (FULL, WEAKER)
    }
    if len(by_light[FULL]) < 2:
        raise DataError(
            "expected two or more complete decays under the full light, got "
            f"{len(by_light[FULL])}; go on with labrig resume"
        )
    longest = decays[by_light[FULL][-1]]
    fit = fit_series(longest, states, fixed_rates_per_s=part.choices.fixed_rates_per_s)
    curves = {unit: curve(one, fit) for unit, one in decays.items()}
    rates = [state.k_r_per_s for state in fit.states]
    test = compare_rates(list(curves.values()), rates, flicker_dof(fit))
    rows = {light: [list(decays).index(unit) for unit in by_light[light]] for light in by_light}
    return Saturation(
        fit=fit,
        charges_s={
            light: np.array([charges[unit] for unit in by_light[light]])
            for light in by_light
            if by_light[light]
        },
        amplitude={light: test.amplitude[rows[light]] for light in by_light if by_light[light]},
        sigma={light: test.amplitude_sigma[rows[light]] for light in by_light if by_light[light]},
        curves=curves,
        test=test,
        levels=_levels(test, rows, [charges[unit] for unit in decays], part),
    )


def _levels(
    test: RatesTest, rows: Mapping[str, Sequence[int]], charges: Sequence[float], part: Part
) -> tuple[Level, ...]:
    weaker = part.protocol.weaker
    if weaker is None or not rows[WEAKER]:
        return ()
    dim, bright = rows[WEAKER][-1], rows[FULL][-1]
    found = []
    for state, k_per_s in enumerate(test.shared_per_s):
        a, b = test.amplitude[[dim, bright], state]
        of_a, of_b = test.amplitude_sigma[[dim, bright], state]
        if b <= 0:
            found.append(Level(0.0, 1.0))
            continue
        ratio = max(a / b, 1e-6)
        sigma = float(np.hypot(of_a / b, a / b * of_b / b))
        both = (charges[dim], charges[bright])
        found.append(level(ratio, sigma, weaker.share, weaker.share_sigma, float(k_per_s), both))
    return tuple(found)


def _write(path: Path, found: Mapping[str, Saturation]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["patch", "light", "charge_s", "k_r_per_s", "amplitude", "amplitude_sigma"])
        for name, one in found.items():
            for light, charges in one.charges_s.items():
                for row, charge_s in enumerate(charges):
                    for state, k_per_s in enumerate(one.test.shared_per_s):
                        numbers = (
                            charge_s, k_per_s, one.amplitude[light][row, state],
                            one.sigma[light][row, state],
                        )  # fmt: skip
                        table.writerow([name, light, *(f"{number:.6g}" for number in numbers)])
