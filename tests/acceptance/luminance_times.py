"""Does the forecast of the time until 0.3 mcd/m² hold, where the record ended before?

    python -m tests.acceptance.luminance_times [--decays 200] [--point-fits 50] [--further]

Each decay is drawn by its own seed: its family and the family's parameters, a true time between 1 h
and 15 h, 16 to 300 readings, even or logarithmic in time, noise of 0.5 % to 5 % with a floor of up
to 0.01 mcd/m², σ given or not, and an error of the scale of none or 3 %. The record ends at a part
of the true time. No fitted law contains the families log-normal rates and power, then exponential;
`--further` takes four others, of which a law contains the first only.

Per cell: how many ranges hold the true time and how many are not determined (only the earliest time
is stated, which must hold), in per cent; the median ratio of upper to lower end, and the mean
interval score (Gneiting and Raftery 2007) of ln t at 95 %, of the determined ranges; how many of
the earliest times hold, of all decays. Last, of the first `--point-fits` decays, the same of the
range of the point fits of the laws that describe the readings.
"""

import argparse
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from labrig.fit import fit_decay, fit_luminance
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
from labrig.material import DECAY_LAWS
from labrig.results import NORMAL_95, VISIBLE_MCD_PER_M2

PARTS = (0.1, 0.3, 0.5, 0.9)
LEVEL = 0.05
SCALE = 0.03
#: Light at 1 min over that at the end, least and largest.
FALL = (30.0, 10_000.0)
HOUR_S = 3600.0
#: Seed of the first further family.
FURTHER_SEED = 100
Curve = Callable[[FloatArray], FloatArray]


def _between(rng: np.random.Generator, low: float, high: float) -> float:
    """Return a number whose logarithm is even."""
    return float(np.exp(rng.uniform(math.log(low), math.log(high))))


def _law(name: str, rate_per_s: float, shape: float) -> Curve:
    law = DECAY_LAWS[name]
    return lambda t_s: law.value(rate_per_s * t_s, np.asarray(shape))


def becquerel(rng: np.random.Generator, end_s: float) -> Curve:
    """Draw (1 + t/τ)^−p."""
    exponent = rng.uniform(0.9, 2.2)
    return _law("becquerel", exponent / _between(rng, 10, 600), 1 / exponent)


def retrapping(rng: np.random.Generator, end_s: float) -> Curve:
    """Draw the decay of a trap with retrapping."""
    return _law("otor", 1 / _between(rng, 30, 2000), rng.uniform(0.1, 1.0))


def stretched(rng: np.random.Generator, end_s: float) -> Curve:
    """Draw a stretched exponential."""
    return _law("stretched", _between(rng, 2, 1000) / end_s, rng.uniform(0.25, 0.9))


def exponentials(rng: np.random.Generator, end_s: float) -> Curve:
    """Draw a sum of two or three exponentials."""
    n = int(rng.integers(2, 4))
    rate = _between(rng, 1.5, 6.0) / end_s
    rates, shares = [rate], [1.0]
    for _ in range(n - 1):
        rates.append(rates[-1] * _between(rng, 3, 10))
        shares.append(shares[-1] * _between(rng, 2, 10))
    return lambda t_s: np.exp(-np.multiply.outer(t_s, rates)) @ np.array(shares)


def becquerel_and_exponential(rng: np.random.Generator, end_s: float) -> Curve:
    """Draw the sum of Becquerel's law and an exponential."""
    power = becquerel(rng, end_s)
    rate = _between(rng, 1.0, 20.0) / end_s
    equal_s = np.array([_between(rng, 0.02, 0.5) * end_s])
    share = _between(rng, 0.3, 3.0) * float(power(equal_s)[0]) * math.exp(rate * equal_s[0])
    return lambda t_s: power(t_s) + share * np.exp(-rate * t_s)


def log_normal_rates(rng: np.random.Generator, end_s: float) -> Curve:
    """Draw a log-normal distribution of rates."""
    return _many_rates(_between(rng, 1, 300) / end_s, rng.uniform(0.7, 2.5), 2.0)


def flat_topped_rates(rng: np.random.Generator, end_s: float) -> Curve:
    """Draw a distribution of rates whose logarithm falls with the fourth power."""
    return _many_rates(_between(rng, 1, 300) / end_s, rng.uniform(1.5, 4.0), 4.0)


def tunnelling_that_ends(rng: np.random.Generator, end_s: float) -> Curve:
    """Draw a power law that ends in an exponential."""
    exponent, rate = rng.uniform(0.8, 1.5), _between(rng, 0.2, 5.0) / end_s
    begin_s = _between(rng, 3, 60)
    return lambda t_s: (1 + t_s / begin_s) ** -exponent * np.exp(-rate * t_s)


def two_powers(rng: np.random.Generator, end_s: float) -> Curve:
    """Draw the sum of two of Becquerel's laws."""
    first, second = becquerel(rng, end_s), becquerel(rng, end_s)
    share = _between(rng, 0.03, 1.0)
    return lambda t_s: first(t_s) + share * second(t_s)


def stretched_and_retrapping(rng: np.random.Generator, end_s: float) -> Curve:
    """Draw the sum of a stretched exponential and a trap with retrapping."""
    first, second = stretched(rng, end_s), retrapping(rng, end_s)
    share = _between(rng, 0.1, 10.0)
    return lambda t_s: first(t_s) + share * second(t_s)


def _many_rates(rate_per_s: float, width: float, power: float) -> Curve:
    """Return the light of emptied traps whose ln k is distributed as exp(−|z|^power/2)."""
    z = np.linspace(-4, 4, 161)
    rates = rate_per_s * np.exp(width * z)
    weights = np.exp(-(np.abs(z) ** power) / 2) * rates
    return lambda t_s: np.exp(-np.multiply.outer(t_s, rates)) @ weights


FAMILIES = {
    "Becquerel": becquerel,
    "retrapping": retrapping,
    "stretched": stretched,
    "2-3 exponentials": exponentials,
    "log-normal rates": log_normal_rates,
    "power, then exponential": tunnelling_that_ends,
}
FURTHER = {
    "Becquerel + exponential": becquerel_and_exponential,
    "flat-topped rates": flat_topped_rates,
    "two Becquerels": two_powers,
    "stretched + retrapping": stretched_and_retrapping,
}


@dataclass(frozen=True)
class Record:
    """Readings of a decay that end before its time; `sigma` is None where none is given."""

    t_s: FloatArray
    light: FloatArray
    sigma: FloatArray | None
    scale_sigma: float
    end_s: float


def drawn_record(family: int, draw: Callable[..., Curve], part: float, number: int) -> Record:
    """Return the record of one decay up to a part of its time."""
    rng = np.random.default_rng([family, number, 47])
    while True:
        end_s = _between(rng, HOUR_S, 15 * HOUR_S)
        curve = draw(rng, end_s)
        level = VISIBLE_MCD_PER_M2 / curve(np.array([end_s]))[0]
        if FALL[0] < level * curve(np.array([60.0]))[0] / VISIBLE_MCD_PER_M2 < FALL[1]:
            break
    noise, floor = _between(rng, 0.005, 0.05), rng.uniform(0, 0.01)
    scale_sigma = SCALE * float(rng.integers(0, 2))
    scale = 1 + scale_sigma * rng.standard_normal()
    is_even, has_sigma = rng.integers(0, 2, size=2)
    n = round(_between(rng, 16, 300))
    rng = np.random.default_rng([family, number, round(100 * part)])
    last_s = part * end_s
    first_s = min(_between(rng, 10, 120), last_s / 15)
    t_s = np.linspace(last_s / n, last_s, n) if is_even else np.geomspace(first_s, last_s, n)
    light = level * curve(t_s)
    sigma = np.hypot(noise * light, floor)
    read = scale * light + sigma * rng.standard_normal(n)
    return Record(t_s, read, sigma if has_sigma else None, scale_sigma, end_s)


Range = tuple[float, float]


def forecast(record: Record) -> tuple[Range | None, float]:
    """Return the range that labrig states and its earliest time, 0 where that was measured.

    A time that was reached is measured within twice its σ.
    """
    found = fit_luminance(record.t_s, record.light, record.sigma, scale_sigma=record.scale_sigma)
    if found.visible_s is not None:
        value, sigma = found.visible_s.value, found.visible_s.sigma
        return (value - NORMAL_95 * sigma, value + NORMAL_95 * sigma), 0.0
    if found.visible_forecast is None:
        return None, 0.0
    between_s = found.visible_forecast.between_s
    return between_s, found.visible_forecast.least_s


def point_fit_range(record: Record) -> Range | None:
    """Return the range of the laws' point fits."""
    try:
        decay = fit_decay(record.t_s, record.light, record.sigma)
    except FitError:
        return None
    later_s = record.t_s[-1] * np.geomspace(1.0, 300.0, 400)
    forecast = decay.forecast(later_s)
    ends = []
    for light in (forecast.low, forecast.high):
        below = np.flatnonzero(light < VISIBLE_MCD_PER_M2)
        ends.append(float(later_s[below[0]]) if len(below) else math.inf)
    return ends[0], ends[1]


def interval_score(low: float, high: float, true: float) -> float:
    """Return the interval score of ln t."""
    outside = max(math.log(low / true), math.log(true / high), 0.0)
    return math.log(high / low) + 2 / LEVEL * outside


def stated(ranges: list[Range | None], least_s: list[float], true_s: list[float]) -> str:
    """Return the columns of a cell's ranges; one that is not determined ends nowhere."""
    n = len(true_s)
    every = [
        (least, math.inf) if one is None else one
        for one, least in zip(ranges, least_s, strict=True)
    ]
    held = sum(low <= true <= high for (low, high), true in zip(every, true_s, strict=True))
    finite = [
        (low, high, true)
        for (low, high), true in zip(every, true_s, strict=True)
        if math.isfinite(high)
    ]
    ratio = float(np.median([high / low for low, high, _ in finite])) if finite else math.nan
    score = float(np.mean([interval_score(*one) for one in finite])) if finite else math.nan
    open_ = 100 * (1 - len(finite) / n)
    return f"{100 * held / n:6.1f} {open_:6.1f} {ratio:6.2f} {score:6.2f}"


COLUMNS = f"{'held %':>6} {'open %':>6} {'ratio':>6} {'score':>6}"
HEAD = (
    f"{'':24} {'':5}  {'forecast':27}  {'':7}  point fits\n"
    f"{'family':24} {'ended':>5}  {COLUMNS}  {'least %':>7}  {COLUMNS}"
)


def row(name: str, part: float, records: list[Record], n_point_fits: int) -> str:
    """Return the line of a cell, with point fits of its first records."""
    true_s = [one.end_s for one in records]
    ranges, least_s = (list(column) for column in zip(*map(forecast, records), strict=True))
    least = 100 * np.mean(np.array(least_s) <= true_s)
    before = [point_fit_range(one) for one in records[:n_point_fits]]
    cells = (
        f"{name:24} {part:5}",
        stated(ranges, least_s, true_s),
        f"{least:7.1f}",
        stated(before, [math.inf] * len(before), true_s[:n_point_fits]),
    )
    return "  ".join(cells)


def main() -> None:
    """Print a line for each cell."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--decays", type=int, default=200)
    parser.add_argument("--point-fits", type=int, default=50)
    parser.add_argument("--further", action="store_true")
    arguments = parser.parse_args()
    families = FURTHER if arguments.further else FAMILIES
    numbers = range(arguments.decays)
    print(HEAD)
    for index, (name, draw) in enumerate(families.items(), FURTHER_SEED * arguments.further):
        for part in PARTS:
            records = [drawn_record(index, draw, part, number) for number in numbers]
            print(row(name, part, records, arguments.point_fits), flush=True)


if __name__ == "__main__":
    main()
