"""Options of `labrig process` for fluorescence under LEDs."""

from pydantic import Field

from labrig.analyse.process_options import ProcessOptions
from labrig.results import EstimateMethod


class LedFluorescenceOptions(ProcessOptions):
    """Options of the estimate of re-radiation."""

    method: EstimateMethod | None = Field(
        None,
        description="How re-radiation is estimated: 'joint', all LEDs together, or 'per-led', one "
        "LED by itself as in McEvoy's thesis.",
    )
