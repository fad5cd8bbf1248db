"""Luminances that the runs of a queue found, and how they depend on what was changed."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from labrig.errors import LabrigError
from labrig.results import LuminanceResult, Measured, read_result

#: Fewest values of a key whose scatter gives a slope a σ.
FEWEST = 3


@dataclass(frozen=True)
class FoundLuminance:
    """A luminance at one time after lamp off.

    Attributes
    ----------
    patch
        Name of the patch.
    t_s
        Time after lamp off in seconds.
    luminance
        Luminance in mcd/m².
    """

    patch: str
    t_s: float
    luminance: Measured


def found_luminances(run: Path) -> Iterator[FoundLuminance]:
    """Iterate over the luminances of a processed run; none of a run of another protocol."""
    try:
        result = read_result(run)
    except LabrigError:
        return
    if isinstance(result, LuminanceResult):
        for name, patch in result.patches.items():
            for entry in patch.decay.at:
                if entry.luminance is not None:
                    yield FoundLuminance(name, entry.t_s, entry.luminance)


def dose_slope(dose: Sequence[float], luminance: Sequence[Measured]) -> Measured | None:
    """Return the slope d ln L/d ln dose of a charge–dose curve, with σ by the scatter about it.

    The scale of the luminances, which their σ contain, cancels.

    Parameters
    ----------
    dose
        Doses, such as times of excitation in seconds.
    luminance
        Luminance after each.

    Returns
    -------
    Measured or None
        Slope; None of fewer than three different doses, or of doses or luminances that are not
        above zero.

    Examples
    --------
    >>> from labrig.queue import dose_slope
    >>> from labrig.results import Measured
    >>> light = [Measured(value, 0.5, "mcd/m²") for value in (10.0, 19.0, 41.0)]
    >>> print(dose_slope([60.0, 120.0, 240.0], light))
    1.018(53)
    """
    value = np.array([one.value for one in luminance])
    x = np.asarray(dose, dtype=np.float64)
    if len(set(dose)) < FEWEST or not ((x > 0).all() and (value > 0).all()):
        return None
    logs = np.log(x) - np.log(x).mean()
    slope = float(logs @ np.log(value) / (logs @ logs))
    left = np.log(value) - np.log(value).mean() - slope * logs
    variance = float(left @ left) / (len(x) - 2) / float(logs @ logs)
    return Measured(slope, float(np.sqrt(variance)))
