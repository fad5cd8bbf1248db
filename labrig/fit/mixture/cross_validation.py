"""How well mixtures predict entries of a matrix that they were not fitted to."""

from collections.abc import Iterator
from itertools import islice

import numpy as np

from labrig.fit.mixture.candidate import candidates
from labrig.fit.mixture.entries import StokesEntries
from labrig.fit.mixture.result import HeldOutError
from labrig.fit.mixture.scaling import modelled

FOLDS = 5
SEED = 2021


def held_out_errors(entries: StokesEntries, most: int, skewed: bool) -> list[HeldOutError]:
    """Return the errors of 1 to `most` components, each entry predicted from other ones.

    Entries are dealt out by chance to five folds of equal size, always the same.
    """
    deal = np.random.default_rng(SEED).permutation(len(entries.value)) % FOLDS
    by_fold = [list(_errors(entries, deal == fold, most, skewed)) for fold in range(FOLDS)]
    return [
        HeldOutError(float(np.mean(errors)), float(np.std(errors, ddof=1) / np.sqrt(FOLDS)))
        for errors in zip(*by_fold, strict=True)
    ]


def _errors(
    entries: StokesEntries, held_out: np.ndarray, most: int, skewed: bool
) -> Iterator[float]:
    training, test = entries.where(~held_out), entries.where(held_out)
    for candidate in islice(candidates(training, 1, skewed, is_final=False), most):
        off = modelled(test, candidate.mixture) - test.wanted
        yield float(np.average(off**2, weights=test.weight**2))
