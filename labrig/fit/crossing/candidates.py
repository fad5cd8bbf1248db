"""Laws of decay that may go on beyond a record, with parameters that have normal priors.

All are ln L over x = ln t. Rates are relative to the last time T, so that priors are those of what
a record can show: a law bends somewhere within it.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.special import expit

from labrig.fit.crossing.readings import LogDecay
from labrig.foundation.arrays import FloatArray
from labrig.material import DECAY_LAWS

#: Least and largest shape of a law of a rate and a shape.
SHAPES = {"becquerel": (0.0, 2.0), "otor": (0.0, 1.0), "stretched": (0.1, 1.0)}
#: Numbers of exponentials.
N_EXPONENTIALS = (2, 3)
#: Priors, mean and σ: ln of the amplitude above the first reading, ln of the rate times T, and the
#: logit of the shape.
AMPLITUDE, RATE, LOGIT = (1.0, 4.0), (1.5, 3.0), (0.0, 1.5)
#: Priors of exponentials: ln of the slowest one's amplitude above the last reading and of its rate
#: times T; ln of the ratio of amplitudes and of rates from one to the next faster.
SLOWEST_AMPLITUDE, SLOWEST_RATE = (1.5, 3.0), (0.7, 1.3)
NEXT_AMPLITUDE, NEXT_RATE = (1.3, 1.5), (1.6, 0.8)
#: Priors of an exponential that is added to a law: part of the last time at which its light is
#: given, and its ln relative to the whole there.
ADDED_AT, ADDED_LIGHT = 1 / 3, (-1.0, 1.5)
#: Least luminance of a law, of which the logarithm is finite.
LEAST = 1e-300

#: Parameters (b, p) and ln t (n,) → ln L (b, n).
Model = Callable[[FloatArray, FloatArray], FloatArray]


@dataclass(frozen=True)
class Candidate:
    """A law with normal priors.

    Attributes
    ----------
    name
        Name of the law.
    log_light
        Function of parameters (b, p) and ln t (n,) that returns ln L (b, n).
    mean, sigma
        Mean and σ of the parameters before the record, shape (p,).
    starts
        Parameters from which fits begin, shape (m, p).
    """

    name: str
    log_light: Model
    mean: FloatArray
    sigma: FloatArray
    starts: FloatArray


def candidates(decay: LogDecay) -> tuple[Candidate, ...]:
    """Return the laws with priors for a record."""
    becquerel, *others = (_law(name, decay) for name in SHAPES)
    exponentials = (_exponentials(n, decay) for n in N_EXPONENTIALS)
    return (becquerel, *others, *exponentials, _with_exponential(becquerel, decay))


def _law(name: str, decay: LogDecay) -> Candidate:
    value, (least, largest) = DECAY_LAWS[name].value, SHAPES[name]

    def log_light(theta: FloatArray, x: FloatArray) -> FloatArray:
        shape = least + (largest - least) * expit(theta[:, 2:])
        light = value(np.exp(theta[:, 1:2] + x), shape)
        return np.asarray(theta[:, :1] + np.log(np.maximum(light, LEAST)))

    first, last = float(decay.log_light[0]), float(decay.log_time[-1])
    mean = np.array([first + AMPLITUDE[0], RATE[0] - last, LOGIT[0]])
    sigma = np.array([AMPLITUDE[1], RATE[1], LOGIT[1]])
    steps = sigma * np.array([[0.0, -0.3, 0.0], [0.0, 0.6, 0.3]])
    return Candidate(name, log_light, mean, sigma, mean + steps)


def _with_exponential(law: Candidate, decay: LogDecay) -> Candidate:
    """Return the sum of a law and one exponential, which may hide the law's tail."""
    n = len(law.mean)
    last_s = float(np.exp(decay.log_time[-1]))
    at_s = ADDED_AT * last_s
    level = float(np.interp(np.log(at_s), decay.log_time, decay.log_light))

    def log_light(theta: FloatArray, x: FloatArray) -> FloatArray:
        rate = np.exp(theta[:, n + 1 :])
        added = theta[:, n : n + 1] - rate * (np.exp(x) - at_s)
        return np.logaddexp(law.log_light(theta[:, :n], x), added)

    mean = np.array([*law.mean, ADDED_LIGHT[0] + level, SLOWEST_RATE[0] - np.log(last_s)])
    sigma = np.array([*law.sigma, ADDED_LIGHT[1], SLOWEST_RATE[1]])
    starts = np.stack([mean, mean])
    starts[:, :n] = law.starts
    starts[1, n + 1] += 0.8
    return Candidate(f"{law.name} and exponential", log_light, mean, sigma, starts)


def _exponentials(n: int, decay: LogDecay) -> Candidate:
    def log_light(theta: FloatArray, x: FloatArray) -> FloatArray:
        amplitudes = np.cumsum(theta[:, 0::2], axis=1)
        rates = np.exp(np.cumsum(theta[:, 1::2], axis=1))
        terms = amplitudes[:, :, None] - rates[:, :, None] * np.exp(x)
        highest = terms.max(axis=1)
        return np.asarray(highest + np.log(np.exp(terms - highest[:, None]).sum(axis=1)))

    level, last = float(decay.log_light[-1]), float(decay.log_time[-1])
    mean = np.array(
        [SLOWEST_AMPLITUDE[0] + level, SLOWEST_RATE[0] - last]
        + [NEXT_AMPLITUDE[0], NEXT_RATE[0]] * (n - 1)
    )
    sigma = np.array(
        [SLOWEST_AMPLITUDE[1], SLOWEST_RATE[1]] + [NEXT_AMPLITUDE[1], NEXT_RATE[1]] * (n - 1)
    )
    faster = np.zeros_like(mean)
    faster[1] = 0.8
    return Candidate(f"{n} exponentials", log_light, mean, sigma, np.stack([mean, mean + faster]))
