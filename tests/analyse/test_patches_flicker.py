"""Flicker that patches of the same frames have in common."""

from dataclasses import replace
from functools import partial

from labrig.analyse.series_fit import fit_series
from labrig.fit import DecayFit
from labrig.protocols.decay.analysis import fit_patches
from tests.report.made import decay_series


def test_the_patch_that_determines_the_flicker_best_gives_it_to_the_others() -> None:
    bright = decay_series(60, seed=1, name="bright")
    dim = replace(decay_series(60, seed=2, name="dim"), values=bright.values / 40)
    fit = partial(fit_series, states=2)
    alone, own = fit(bright), fit(dim)
    together = fit_patches({"dim": dim, "bright": bright}, fit)
    assert all(isinstance(one, DecayFit) for one in together.values())
    found = {name: one.flicker for name, one in together.items() if isinstance(one, DecayFit)}
    assert alone.flicker_sigma / alone.flicker < own.flicker_sigma / max(own.flicker, 1e-9)
    assert found == {"dim": alone.flicker, "bright": alone.flicker}
    assert own.flicker != alone.flicker
