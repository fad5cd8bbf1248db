"""Options of `labrig process` for a decay."""

from pydantic import Field, field_validator

from labrig.analyse.process_options import IntervalsOption, RateOption, StatesOption
from labrig.results import AUTO, require_law


class DecayOptions(StatesOption, RateOption, IntervalsOption):
    """Options of the fit of a decay."""

    law: str = Field(AUTO, description="Law of decay, as of 'labrig fit decay'.")

    @field_validator("law")
    @classmethod
    def _registered(cls, law: str) -> str:
        require_law(law)
        return law
