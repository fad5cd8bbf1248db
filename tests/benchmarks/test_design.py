"""A design of four keys in 200 frames, against a grid of rates."""

from collections.abc import Callable

from labrig.design import solve, three_bands
from tests.acceptance.design_grid import eliminated_grid
from tests.design.scenes import film

Against = Callable[..., None]


def test_four_keys_in_200_frames(against: Against) -> None:
    """The grid's residual is higher, see `tests.acceptance.design_grid`."""
    light, keys = film(0)
    weight = 1 / keys.luminance(three_bands())
    against(
        lambda: solve(light, keys, three_bands(), albedo=0.3),
        {"a grid of 10⁴ rates, Λ eliminated": lambda: eliminated_grid(light, keys, weight, 10)},
        rounds=10,
        what="four keys in 200 frames: design",
    )
