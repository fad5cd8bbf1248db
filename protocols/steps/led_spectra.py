"""Readings of a spectrometer whose integration time is metered."""

from dataclasses import dataclass

import numpy as np

from labrig.acquire import SPECTROMETER, ReadSpectrum, Session
from labrig.foundation.quantity import duration_text
from labrig.optics import read_spectrometer_reading
from labrig.record import FrameRole, SpectrumRecord

from .bracketing import ENOUGH

#: Integration times of metering, as fractions of the longest.
LADDER = (1 / 1000, 1 / 100, 1 / 10, 1)
#: Fraction of the range that the strongest pixels may fill: room for a drift of the LED.
TARGET = 0.6
#: Number of neighbouring pixels whose mean is the strongest light, so that it is not noise.
NEIGHBOURS = 5


@dataclass(frozen=True)
class SpectrumReadings:
    """Readings of one light with the integration time that fits it.

    Attributes
    ----------
    longest_s
        Longest integration time in seconds.
    repetitions
        Number of spectra in a reading.
    """

    longest_s: float
    repetitions: int

    def meter(self, session: Session, unit: str) -> None:
        """Read single spectra, each longer than the one before, until one is bright enough."""
        for integration_s in self._ladder(session):
            session.perform(ReadSpectrum(FrameRole.METER, integration_s, 1))
            if session.decide(
                "spectrum bright enough", lambda: self._is_bright(session, unit), when_planned=False
            ):
                break

    def read(self, session: Session, role: str, unit: str) -> None:
        """Read with the integration time that the unit's metering tells."""
        low_s, high_s = self._limits_s(session)
        chosen_s = session.decide(
            "integration", lambda: self._integration_s(session, unit, low_s, high_s), high_s
        )
        session.perform(ReadSpectrum(role, chosen_s, self.repetitions))

    def _limits_s(self, session: Session) -> tuple[float, float]:
        low_s, high_s = session.rig[SPECTROMETER].integration_limits_s()
        return low_s, max(low_s, min(high_s, self.longest_s))

    def _ladder(self, session: Session) -> list[float]:
        low_s, high_s = self._limits_s(session)
        return sorted({max(low_s, high_s * fraction) for fraction in LADDER})

    def _is_bright(self, session: Session, unit: str) -> bool:
        return _fraction(_metered(session, unit)[-1])[0] > ENOUGH

    def _integration_s(self, session: Session, unit: str, low_s: float, high_s: float) -> float:
        """Return the integration time in whole milliseconds, or the shortest one."""
        last = _metered(session, unit)[-1]
        fraction, is_saturated = _fraction(last)
        if is_saturated and last.integration_s <= low_s * (1 + 1e-9):
            session.warn(
                f"{unit}: the spectrometer is saturated even in {duration_text(low_s)}; dim the "
                "LED, or move the spectrometer's head away"
            )
            return low_s
        wanted_s = last.integration_s * TARGET / max(fraction, 1e-3)
        wanted_s = last.integration_s / 10 if is_saturated else wanted_s
        return float(np.clip(np.floor(wanted_s * 1e3) / 1e3, low_s, high_s))


def _metered(session: Session, unit: str) -> list[SpectrumRecord]:
    return [record for record in session.spectra(FrameRole.METER) if record.unit == unit]


def _fraction(record: SpectrumRecord) -> tuple[float, bool]:
    """Return the fraction of the range that the strongest light fills, and whether it is beyond."""
    reading = read_spectrometer_reading(record.path)
    counts = np.convolve(reading.corrected().counts, np.ones(NEIGHBOURS) / NEIGHBOURS, "valid")
    return float(counts.max() / reading.saturation_counts), bool(reading.saturated.any())
