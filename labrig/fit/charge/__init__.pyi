from .fit import fit_charge_and_decay as fit_charge_and_decay
from .result import (
    ChargeCandidate as ChargeCandidate,
    ChargeFit as ChargeFit,
    OrderState as OrderState,
)
