"""Charge and decay of one series, fitted together with states of general kinetic order."""

from labrig.fit.charge.fit import fit_charge_and_decay
from labrig.fit.charge.result import ChargeCandidate, ChargeFit, OrderState

__all__ = ["ChargeCandidate", "ChargeFit", "OrderState", "fit_charge_and_decay"]
