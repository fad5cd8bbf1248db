"""Forecast of the time at which a decay falls to a level after its last reading."""

from labrig.fit.crossing.forecast import forecast_crossing

__all__ = ["forecast_crossing"]
