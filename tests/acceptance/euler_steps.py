"""Errors of levels by Euler's method, by Runge and Kutta's and by exact steps.

    python -m tests.acceptance.euler_steps [--picture FILE]

Nalbach et al. step the rate equation of their materials by Euler's method, and find no need of
another in their supplement. Here a level is empty, is charged for 60 s and decays for 60 s, by
`Field.step` with `euler` and `exact`, and by the classical Runge-Kutta method of order four in
double precision. The light is that of the material's own norm, or ten times as much: steady, or
swinging between darkness and that in 4 s, sin²; Euler's steps see it at their beginning, exact
ones in their middle, and those of Runge and Kutta at begin, middle and end.

Errors are the largest of a level over all steps, absolute: levels run from 0 to 1. Truth is DOP853
to 1e-12. `unstable` where a level leaves 0 to 1 by more than 0.01.
"""

import argparse
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from labrig.foundation.arrays import FloatArray
from labrig.material import read_material
from labrig.reproduce import Field, FieldParameters

MATERIALS = ("red-paint", "blue-paint", "green-paint", "yellow-paint")
LIT_S, PERIOD_S = 60.0, 4.0
#: Lengths of steps in s, all of which divide the time of the light; the third is a video's frame.
STEPS_S = (0.01, 0.02, 0.04, 0.1, 0.2, 0.4, 1.0, 2.0, 5.0, 10.0)
LIGHTS = {"|E| = 1": 1.0, "|E| = 10": 10.0}
#: How far beyond 0 to 1 levels of a stable method may be.
STRAY = 0.01


@dataclass(frozen=True)
class Case:
    """A level under a light programme.

    Attributes
    ----------
    k_per_s, kappa_per_s
        Decay rate, and excitation in full light.
    swings
        Whether the light swings; else it is steady while it is on.
    """

    k_per_s: float
    kappa_per_s: float
    swings: bool

    def light(self, t_s: float) -> float:
        """Return the part of the light at a time while it is on."""
        return math.sin(math.pi * t_s / PERIOD_S) ** 2 if self.swings else 1.0

    def growth(self, t_s: float, level: float, lit: float) -> float:
        """Return dr/dt."""
        return (1 - level) * self.kappa_per_s * lit * self.light(t_s) - self.k_per_s * level

    def truth(self, step_s: float) -> FloatArray:
        """Return the level after each step."""
        return np.concatenate([self._true_part(0.0, 1.0, step_s), self._dark(step_s)])

    def _true_part(self, start: float, lit: float, step_s: float) -> FloatArray:
        times_s = np.arange(1, round(LIT_S / step_s) + 1) * step_s
        solution = solve_ivp(
            lambda t, r: [self.growth(t, r[0], lit)], (0, LIT_S + 1e-9), [start], "DOP853",
            t_eval=times_s, rtol=1e-12, atol=1e-13, max_step=0.5,
        )  # fmt: skip
        return np.asarray(solution.y[0])

    def _dark(self, step_s: float) -> FloatArray:
        times_s = np.arange(1, round(LIT_S / step_s) + 1) * step_s
        charged = self._true_part(0.0, 1.0, LIT_S)[-1]
        return np.asarray(charged * np.exp(-self.k_per_s * times_s))


Stepper = Callable[[Case, float], FloatArray]


def by_field(method: str) -> Stepper:
    """Return the steps of a field, whose light is that at their beginning or in their middle."""
    late = 0.5 if method == "exact" else 0.0

    def levels(case: Case, step_s: float) -> FloatArray:
        parameters = FieldParameters.checked([case.k_per_s], [[case.kappa_per_s]], [[1.0]])
        field, found = Field(parameters, 1), []
        number = round(LIT_S / step_s)
        for step in range(2 * number):
            light = case.light((step + late) * step_s) if step < number else 0.0
            field.step([light], step_s, "euler" if method == "euler" else "exact")
            found.append(float(field.levels[0, 0]))
        return np.array(found)

    return levels


def by_runge_kutta(case: Case, step_s: float) -> FloatArray:
    """Return the steps of the classical method of order four."""
    number, level, found = round(LIT_S / step_s), 0.0, []
    for step in range(2 * number):
        t_s, lit, half_s = step * step_s, float(step < number), step_s / 2
        first = case.growth(t_s, level, lit)
        second = case.growth(t_s + half_s, level + half_s * first, lit)
        third = case.growth(t_s + half_s, level + half_s * second, lit)
        fourth = case.growth(t_s + step_s, level + step_s * third, lit)
        level += step_s / 6 * (first + 2 * second + 2 * third + fourth)
        found.append(level)
    return np.array(found)


METHODS: dict[str, Stepper] = {
    "Euler": by_field("euler"),
    "Runge-Kutta": by_runge_kutta,
    "exact": by_field("exact"),
}


def worst(case: Case, stepper: Stepper, step_s: float) -> float:
    """Return the largest error of the level; infinite if the method is not stable."""
    with np.errstate(over="ignore", invalid="ignore"):
        levels = stepper(case, step_s)
    if not ((levels > -STRAY) & (levels < 1 + STRAY)).all():
        return math.inf
    return float(np.abs(levels - case.truth(step_s)).max())


def case_of(name: str, irradiance: float, *, swings: bool) -> Case:
    """Return a material of one state under a light that is even over its bands."""
    (state,) = read_material(name).states
    k_e = np.array(state.k_e_per_s)
    kappa = irradiance * float(k_e.sum()) / math.sqrt(len(k_e))
    return Case(state.k_r_per_s, kappa, swings)


def main() -> None:
    """Print a table of each light, and draw them if asked."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--picture", type=Path, help="draw the errors into a file")
    options = parser.parse_args()
    found: dict[tuple[str, str, bool, str], list[float]] = {}
    for light, irradiance in LIGHTS.items():
        for swings in (False, True):
            print(f"\n{light}, {'swinging' if swings else 'steady'}: largest error of the level")
            head = "".join(f"{step_s:>10g}" for step_s in STEPS_S)
            print(f"{'material':14}{'κ / 1/s':>9}{'k / 1/s':>9}  {'step / s':12}{head}")
            for name in MATERIALS:
                case = case_of(name, irradiance, swings=swings)
                for method, stepper in METHODS.items():
                    errors = [worst(case, stepper, step_s) for step_s in STEPS_S]
                    found[light, name, swings, method] = errors
                    said = "".join(
                        f"{error:10.1e}" if math.isfinite(error) else f"{'unstable':>10}"
                        for error in errors
                    )
                    print(f"{name:14}{case.kappa_per_s:9.4f}{case.k_per_s:9.4f}  {method:12}{said}")
    if options.picture is not None:
        draw(found, options.picture)


def draw(found: dict[tuple[str, str, bool, str], list[float]], path: Path) -> None:
    """Draw the errors of the slowest and the fastest material against the step."""
    from matplotlib.figure import Figure  # slow to load

    from labrig.report.figure_style import CHANNEL, DASHED, INK, SOLID, figure_style

    colours = {"Euler": CHANNEL["R"], "Runge-Kutta": CHANNEL["B"], "exact": INK}
    with figure_style():
        figure = Figure(figsize=(9.0, 6.0), layout="constrained")
        grid = figure.subplots(2, 2, sharex=True, sharey=True)
        for row, light in enumerate(LIGHTS):
            for column, swings in enumerate((False, True)):
                axes = grid[row, column]
                for name, style in ((MATERIALS[0], DASHED), (MATERIALS[-1], SOLID)):
                    for method, colour in colours.items():
                        errors = np.array(found[light, name, swings, method])
                        errors[~np.isfinite(errors)] = np.nan
                        axes.loglog(STEPS_S, errors, color=colour, linestyle=style,
                                    label=f"{method}, {name}")  # fmt: skip
                axes.set_title(f"{light}, {'swinging' if swings else 'steady'}")
                axes.set_ylim(1e-9, 1)
        for axes in grid[1]:
            axes.set_xlabel("step / s")
        for axes in grid[:, 0]:
            axes.set_ylabel("largest error of the level")
        handles, labels = grid[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
        figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main()
