"""Section of a report on how far each headline value may be trusted, for every protocol."""

from labrig.report.sections import Section, Table
from labrig.results import UNDIVIDED, Budget, RunResult

TITLE = "How far each number may be trusted"
#: Text of a component that is not included.
MISSING = "–"
#: Most budgets that are printed in the terminal.
MAX_LINES = 4
CAPTION = (
    "σ is the root of the sum of squares of its components; a dash is not included in it. A range "
    "by the model is beside σ and not in it."
)


def budget_sections(result: RunResult) -> tuple[Section, ...]:
    """Return the section with the budgets of a result; none where it has none."""
    budgets = result.budgets()
    if not budgets:
        return ()
    causes = [
        cause
        for cause in ("noise", "calibration", UNDIVIDED, "model")
        if any(cause in budget.components for budget in budgets.values())
    ]
    has_range = any(budget.model_range is not None for budget in budgets.values())
    head = (
        "Quantity",
        *(["Range by model"] if has_range else []),
        "Value ± σ",
        *(f"{cause[0].upper()}{cause[1:]}" for cause in causes),
        "Not included",
    )
    rows = tuple(
        (name, *([budget.model_text or MISSING] if has_range else []), *_cells(budget, causes))
        for name, budget in budgets.items()
    )
    return (Section(TITLE, tables=(Table(head, rows, CAPTION),)),)


def budget_lines(result: RunResult) -> tuple[str, ...]:
    """Return the budgets of a result as lines for the terminal, one per headline value.

    Of more than `MAX_LINES` values there is one line, which says that the report has them.
    """
    budgets = result.budgets()
    if len(budgets) > MAX_LINES:
        return (f"budgets of {len(budgets)} values are in the report",)
    return tuple(f"budget of {name}: {budget}" for name, budget in budgets.items())


def _cells(budget: Budget, causes: list[str]) -> tuple[str, ...]:
    """Return value, components and what is not included, a cell each."""
    parts = budget.components
    sizes = (budget.size_text(parts[cause]) if cause in parts else MISSING for cause in causes)
    return (budget.value_text, *sizes, ", ".join(budget.not_included) or "nothing named")
