"""What the example of the page on the decay fit prints, with its flicker and without.

python -m tests.acceptance.decay_fit_example
"""

from pathlib import Path
from typing import Any

from labrig.fit import DecayFit
from tests.docs.console import commands

PAGE = Path(__file__).parents[2] / "docs/explanation/decay_fit.md"
FLICKER, STEADY = "flicker = 1 + 0.007 *", "flicker = 1 + 0 *"


def fit_of(code: str) -> DecayFit:
    """Run a cell of the page and return its fit."""
    names: dict[str, Any] = {}
    exec(compile(code, PAGE.name, "exec"), names)
    fit: DecayFit = names["fit"]
    return fit


def main() -> None:
    """Run the page's cell twice, and print which other models it weighed."""
    (cell,) = (each.text for each in commands(PAGE) if each.kind == "python")
    if FLICKER not in cell:
        raise SystemExit(f"the page's example has another flicker than '{FLICKER}'")
    fit = fit_of(cell)
    for each in fit.candidates:
        print(f"{each.n_states} exponentials: BIC {each.bic:.0f}, F-test p = {each.f_p_value}")
    for law in fit.laws:
        print(f"{law.name}: BIC {law.bic:.0f}")
    print("\nWithout flicker in the data:")
    steady = fit_of(cell.replace(FLICKER, STEADY))
    ratio = fit.states[0].k_r_per_s_sigma / steady.states[0].k_r_per_s_sigma
    print(f"σ of the faster rate is {ratio:.2f} times smaller")


if __name__ == "__main__":
    main()
