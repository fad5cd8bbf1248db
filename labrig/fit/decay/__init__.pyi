from .diagnostics import (
    Periodogram as Periodogram,
    periodogram as periodogram,
)
from .fit import fit_decay as fit_decay
from .result import DecayFit as DecayFit
from .selection import F_TEST_LEVEL as F_TEST_LEVEL
from .shared import (
    DecayTable as DecayTable,
    fit_shared_rates as fit_shared_rates,
)
from .states import APART_SIGMAS as APART_SIGMAS
