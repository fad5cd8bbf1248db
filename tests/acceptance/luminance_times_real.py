"""Does the forecast of the time until a level hold on real decays whose record is cut off before?

    python -m tests.acceptance.luminance_times_real

Decays that other people measured: strontium aluminate after violet light (Castaing et al. 2024),
the luminescence of two quartzes under constant light (CRAN package Luminescence), and of
semiconductors after a laser's pulse at five powers (Grossmann), of which the rates of the third and
the fourth grow with time, as no sum of exponentials does. The level is the first reading over 10,
30 and 100, as far as fifty counts are left of it; the true time is measured by the whole decay. Up
to eighty single readings, evenly spaced in ln t (16 or more), are taken from the start to a part of
that time, from four phases, with σ of their counts and without; time and light are scaled to hours
and 0.3 mcd/m².

Columns as of `tests.acceptance.luminance_times`; a line for each decay and each part.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from labrig.fit import fit_luminance
from labrig.foundation.arrays import FloatArray
from labrig.results import VISIBLE_MCD_PER_M2
from tests.acceptance.luminance_times import (
    HEAD,
    PARTS,
    Record,
    row,
)
from tests.real_data import REAL, SHARED

#: Fall from the first reading to the level, and counts that are left at least.
FALLS, MIN_COUNTS = (10.0, 30.0, 100.0), 50.0
N_READINGS, FEWEST, PHASES = 80, 16, 4
#: Bins of the whole decay, of which the true time is taken.
N_BINS = 150
#: Light of strontium aluminate in counts per unit, and its dark level's end and lamp off.
SAO_COUNT, SAO_DARK_S, SAO_OFF_S = 1.448, 29.0, 330.0


class Decay(NamedTuple):
    """A real decay in counts over the time from its start."""

    name: str
    t_s: FloatArray
    counts: FloatArray
    dark: float


def decays() -> Iterator[Decay]:
    """Yield the real decays."""
    table = SHARED / "decay/perslqy_sao/sample_400_524_300s.txt"
    t_s, light = np.genfromtxt(table, skip_header=1, usecols=(0, 1)).T
    dark = float(light[t_s < SAO_DARK_S].mean())
    later = t_s > SAO_OFF_S + 1
    yield Decay(
        "strontium aluminate",
        t_s[later] - SAO_OFF_S,
        light[later] / SAO_COUNT,
        dark / SAO_COUNT,
    )
    for name in ("bos_wallinga_2012", "bt607"):
        table = SHARED / f"decay/cran_luminescence/cw_osl_{name}_quartz.csv"
        t_s, counts = np.loadtxt(table, delimiter=",", skiprows=1).T
        # Times of one file are the middles of the counts, those of the other their ends.
        middle_s = (t_s[1] - t_s[0]) / 2
        yield Decay(f"quartz {name}", t_s - (t_s[0] - middle_s), counts, 0.0)
    rows = np.genfromtxt(REAL / "trpl_grossmann/sample1.csv", delimiter=",", skip_header=1)
    t_ns, dark_counts = rows[3:, 0], rows[2, 1:]
    for column, dark in enumerate(dark_counts, start=1):
        counts = rows[3:, column]
        used = np.isfinite(counts) & (np.arange(len(counts)) > np.nanargmax(counts) + 3)
        begin_ns = t_ns[np.nanargmax(counts)]
        yield Decay(f"semiconductor {column}", t_ns[used] - begin_ns, counts[used], float(dark))


def records(decay: Decay, part: float) -> Iterator[Record]:
    """Yield records that end at a part of the true times."""
    light = decay.counts - decay.dark
    begin = float(np.median(light[:5]))
    for fall in FALLS:
        level = begin / fall
        if level < MIN_COUNTS:
            continue
        end_s = _true_s(decay, level)
        if end_s is None:
            continue
        hour_s = end_s / 3600
        for phase in range(PHASES):
            times = np.geomspace(decay.t_s[0], part * end_s, N_READINGS) * (1 + 0.02 * phase)
            taken = np.unique(np.searchsorted(decay.t_s, times))
            taken = taken[decay.t_s[taken] <= part * end_s]
            if len(taken) < FEWEST:
                continue
            sigma = np.sqrt(np.maximum(decay.counts[taken], 1.0))
            unit = VISIBLE_MCD_PER_M2 / level
            yield Record(
                decay.t_s[taken] / hour_s,
                unit * light[taken],
                unit * sigma if phase % 2 else None,
                0.0,
                end_s / hour_s,
            )


def _true_s(decay: Decay, level: float) -> float | None:
    """Return the time at which the whole decay falls below a level."""
    x = np.log(decay.t_s)
    place = np.digitize(x, np.linspace(x[0], x[-1], N_BINS))
    numbers = np.bincount(place)
    used = numbers > 0
    t_s = np.exp(np.bincount(place, x)[used] / numbers[used])
    counts = np.bincount(place, decay.counts)[used]
    sigma = np.sqrt(np.maximum(counts, 1.0)) / numbers[used]
    light = counts / numbers[used] - decay.dark
    unit = VISIBLE_MCD_PER_M2 / level
    found = fit_luminance(t_s, unit * light, unit * sigma)
    return None if found.visible_s is None else found.visible_s.value


def main() -> None:
    """Print a line for each decay and part."""
    print(HEAD)
    for decay in decays():
        for part in PARTS:
            every = list(records(decay, part))
            if every:
                print(row(decay.name, part, every, len(every)), flush=True)


if __name__ == "__main__":
    main()
