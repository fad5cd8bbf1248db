"""The least-squares core and SciPy's `trf` from the same bad starts.

    python -m tests.acceptance.least_squares_starts [--seeds N] [--verbose]

Classical problems, NIST's sets and generated ones, from starts up to a million times off. The table
counts, of every kind, where labrig's χ² is lower than that of `scipy.optimize.least_squares`
(`trf`, `x_scale="jac"`, tolerances of the arithmetic), equal to 0.1 %, and higher; how many fits
say that they converged; how many of those are not at a minimum; and how many are at one that is not
the best known. The last column is the number of evaluations, of labrig and of `trf`.
"""

import argparse
from collections.abc import Callable, Iterator

import numpy as np

from tests.acceptance.reference_data import STRD
from tests.fit import strd
from tests.fit.against_trf import WORSE, compared, is_at_minimum
from tests.fit.fit_problems import FAMILIES, Problem, classical, generated


def _misfit(reference: strd.ReferenceSet) -> Callable[[strd.ComplexArray], strd.ComplexArray]:
    model = strd.MODELS[reference.name]
    return lambda b: np.asarray(model(b, reference.x) - reference.y)


def nist(factors: tuple[float, ...] = (1.0, 10.0, 0.1)) -> Iterator[Problem]:
    """Return NIST's sets from both of their starts, and from multiples of them."""
    for name in strd.MODELS:
        reference = strd.read(STRD / f"{name}.dat")
        unbounded = np.full(len(reference.certified), np.inf)
        for number, start in enumerate(reference.starts):
            for factor in factors:
                yield Problem(
                    f"{name} start {number + 1} x {factor:g}",
                    "NIST" if factor == 1 else "NIST, far",
                    _misfit(reference),
                    factor * start,
                    -unbounded,
                    unbounded,
                    reference.certified,
                )


def problems(seeds: int) -> Iterator[Problem]:
    """Return all problems, `seeds` of every generated kind."""
    yield from classical()
    yield from nist()
    for kind in FAMILIES:
        for seed in range(seeds):
            yield generated(kind, seed)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=40)
    parser.add_argument("--verbose", action="store_true", help="name what is worse, or wrong")
    arguments = parser.parse_args()
    results = [result for problem in problems(arguments.seeds) if (result := compared(problem))]
    print(
        f"{'':30}{'better':>7}{'equal':>7}{'worse':>7}{'converged':>11}{'no minimum':>12}"
        f"{'not best':>10}{'evaluations':>14}"
    )
    for kind in [*dict.fromkeys(result.problem.kind for result in results), "all"]:
        those = [result for result in results if kind in (result.problem.kind, "all")]
        ratio = np.array([result.ratio for result in those])
        converged = [result for result in those if result.fit.converged]
        print(
            f"{kind:30}{np.sum(ratio * WORSE < 1):7}"
            f"{np.sum((ratio * WORSE >= 1) & (ratio <= WORSE)):7}{np.sum(ratio > WORSE):7}"
            f"{len(converged):7}/{len(those):<3}"
            f"{sum(not is_at_minimum(result) for result in converged):12}"
            f"{sum(result.above_best > WORSE for result in converged):10}"
            f"{np.mean([result.fit.iterations for result in those]):8.0f}"
            f"{np.mean([result.trf_evaluations for result in those]):6.0f}"
        )
    if arguments.verbose:
        for result in results:
            is_wrong = result.fit.converged and not is_at_minimum(result)
            if result.ratio > WORSE or is_wrong:
                fit = result.fit
                print(
                    f"{result.problem.name:36} {'worse' if result.ratio > WORSE else '     '} "
                    f"{'no minimum' if is_wrong else '          '} chi2 {fit.chi2:.4g}, trf "
                    f"{result.trf:.4g}, best {result.best:.4g}, rank {fit.rank}/"
                    f"{len(fit.parameters)}, converged {fit.converged}, evaluations "
                    f"{fit.iterations} and {result.trf_evaluations}"
                )


if __name__ == "__main__":
    main()
