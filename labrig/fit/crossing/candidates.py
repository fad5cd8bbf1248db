"""Laws of decay that may go on beyond a record, with parameters that have normal priors.

All are ln L over x = ln t. Rates are relative to the last time T, so that priors are those of what
a record can show: a law bends somewhere within it.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.special import expit

from labrig.fit.crossing.readings import LogDecay
from labrig.fit.least_squares import FloatArray
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
    laws = (_law(name, decay) for name in SHAPES)
    return (*laws, *(_exponentials(n, decay) for n in N_EXPONENTIALS))


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
