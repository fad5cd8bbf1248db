"""Oracle: frames whose noise is known because the test made it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from scipy.ndimage import gaussian_filter, uniform_filter

from labrig.reduce import RawFrame, measure
from labrig.reduce.plane_noise import plane_noise

MakeRaw = Callable[..., RawFrame]
Array = npt.NDArray[Any]
SHAPE = (250, 240)
Y, X = np.mgrid[: SHAPE[0], : SHAPE[1]] / 250.0

GRADIENT = 1000 + 8000 * X**3 * np.exp(-(((Y - 0.5) / 0.4) ** 2))
DISC = np.where(np.hypot(X - 0.5, Y - 0.5) < 0.3, 5000.0, 100.0)
GRATING = 3000 * (1 + 0.1 * np.sin(50 * X))


def white(rng: np.random.Generator) -> Array:
    return 1000 + 10 * rng.normal(size=SHAPE)


def faint(rng: np.random.Generator) -> Array:
    return 1000.3 + 0.6 * rng.normal(size=SHAPE)


def hot(rng: np.random.Generator) -> Array:
    pixels = white(rng)
    struck = rng.random(SHAPE) < 0.002
    pixels[struck] += rng.exponential(3000, size=np.count_nonzero(struck))
    return pixels


def texture(rng: np.random.Generator) -> Array:
    """5 % of structure a few pixels wide, as fabric has."""
    cloth = gaussian_filter(rng.normal(size=SHAPE), 3)
    return np.asarray(rng.poisson(5000 * (1 + 0.05 * cloth / cloth.std())))


def blurred(rng: np.random.Generator) -> Array:
    """Noise averaged over 3 × 3: n · Var(mean) is nine times a pixel's variance of 100."""
    wide = rng.normal(size=(SHAPE[0] + 8, SHAPE[1] + 8))
    return 1000 + 30 * uniform_filter(wide, 3)[4:-4, 4:-4]


@dataclass(frozen=True)
class Case:
    name: str
    frame: Callable[[np.random.Generator], Array]
    mean_variance: float


CASES = [
    Case("white", white, 100),
    Case("faint", faint, 0.36 + 1 / 12),
    Case("hot pixels", hot, 100),
    Case("strong gradient", lambda rng: rng.poisson(GRADIENT), GRADIENT.mean()),
    Case("edge", lambda rng: rng.poisson(DISC), DISC.mean()),
    Case("grating", lambda rng: rng.poisson(GRATING), 3000),
    Case("texture", texture, 5000),
    Case("correlated", blurred, 900),
]


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_variance_of_a_mean(case: Case) -> None:
    found = plane_noise(
        [np.rint(case.frame(np.random.default_rng(seed))).astype(np.uint16) for seed in range(12)]
    )
    ratio = np.array([noise.mean_variance for noise in found]) / case.mean_variance
    # σ within 3.5 % on average and 10 % in any frame.
    assert ratio.mean() == pytest.approx(1, abs=0.07)
    assert np.abs(ratio - 1).max() < 0.2
    correlated = case.frame is blurred
    assert all((noise.correlation > 1) == correlated for noise in found)


def test_noise_follows_brightness() -> None:
    (noise,) = plane_noise([np.random.default_rng(0).poisson(GRADIENT).astype(np.uint16)])
    levels = np.array([1500.0, 3000.0, 6000.0])
    assert noise.variance_at(levels) == pytest.approx(levels, rel=0.1)


@pytest.mark.parametrize(
    "region", [pytest.param(None, marks=pytest.mark.campaign), (31, 17, 48, 52)]
)
def test_sigma_covers_the_truth_as_often_as_it_says(
    make_raw: MakeRaw, region: tuple[int, int, int, int] | None
) -> None:
    x, y, w, h = region or (0, 0, SHAPE[1], SHAPE[0])
    truth = (GRADIENT - 1000)[y : y + h, x : x + w]
    pulls = []
    for seed in range(150):
        raw = make_raw(np.random.default_rng(seed).poisson(GRADIENT))
        channels = measure(raw, region).channels
        for name, rows, columns in (("R", y % 2, x % 2), ("B", 1 - y % 2, 1 - x % 2)):
            expected = truth[rows::2, columns::2].mean()
            pulls.append((channels[name].mean - expected) / channels[name].sigma)
    pull = np.array(pulls)
    # 300 pulls: mean 0 ± 0.06, standard deviation 1 ± 0.04, three of each allowed.
    assert abs(pull.mean()) < 0.18
    assert 0.88 < pull.std() < 1.12
    assert 0.60 < np.mean(np.abs(pull) < 1) < 0.77


def test_without_noise_rounding_remains(make_raw: MakeRaw) -> None:
    stats = measure(make_raw(np.full((60, 60), 1234))).channels["G"]
    assert (stats.mean, stats.std) == (234, 0)
    assert stats.sigma == pytest.approx(1 / np.sqrt(12))
