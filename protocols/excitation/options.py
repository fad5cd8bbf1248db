"""Options of `labrig process` for excitation."""

from pydantic import Field, field_validator

from labrig.analyse.process_options import IntervalsOption, StatesOption
from labrig.material import MAX_ORDER
from labrig.results import AUTO

#: Kinetic orders that are fitted, one of each state.
FREE = "free"


class ExcitationOptions(StatesOption, IntervalsOption):
    """Options of the fit of excitation rates."""

    order: str = Field(
        AUTO,
        description="Kinetic order: 'auto' chooses, 1 is the rate equation, 'free' fits one of "
        "each state, a number holds it.",
    )

    @field_validator("order")
    @classmethod
    def _order(cls, text: str) -> str:
        if text in (AUTO, FREE):
            return text
        try:
            is_order = 1 <= float(text) <= MAX_ORDER
        except ValueError:
            is_order = False
        if not is_order:
            raise ValueError(f"expected {AUTO}, {FREE} or a number from 1 to {MAX_ORDER:g}")
        return text
