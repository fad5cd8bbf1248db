"""Decay results with given numbers, for tests of what becomes of them; results read back."""

import json
import math
from collections.abc import Mapping
from contextlib import redirect_stdout
from dataclasses import fields, is_dataclass
from doctest import DocTestParser
from io import StringIO
from typing import Any

import numpy as np

from labrig.protocols.phosphor.result import PhosphorResult
from labrig.results import DecayState, FittedDecay, RunResult


def decay_result(
    *states: tuple[float, float],
    sigma: float = 0.01,
    weights: Mapping[str, float] | None = None,
    offset: float = 0.0,
    offset_sigma: float = 0.001,
) -> FittedDecay:
    """A result with rates and amplitudes (k_r, a) that are known to a relative `sigma`."""
    weights = weights or {"G": 1.0}
    n = len(weights)
    return FittedDecay(
        states=tuple(DecayState(k, sigma * k, a, sigma * a) for k, a in states),
        channels=tuple(weights),
        channel_weights=tuple(weights.values()),
        channel_weights_sigma=(0.0,) * n,
        offsets=(offset,) * n,
        offsets_sigma=(offset_sigma,) * n,
        repeats=("decay-1",),
        levels=(1.0,),
        flicker=0.005,
        flicker_sigma=math.inf,
        chi2=100.0,
        dof=100,
        bic=120.0,
        covariance=np.eye(2 * len(states) + 1),
        warnings=(),
        candidates=(),
        law="exponentials",
        laws=(),
        rate_spectrum=None,
        measured_until_s=100.0,
    )


def assert_read_back(result: RunResult) -> None:
    """What is written as `result.json` gives the same result, field by field, bit by bit.

    With it the notebook cell in the type's documentation runs.
    """
    again = type(result).from_dict(json.loads(result.to_json(), parse_constant=_no_number))
    _assert_same(result, again, result.kind)
    assert again.to_xarray().to_dict()
    assert len(again.to_pandas("values"))
    assert again._repr_html_()
    cell = DocTestParser().get_examples(type(result).__doc__ or "")[1:]
    with redirect_stdout(StringIO()) as printed:
        exec("".join(example.source for example in cell), {"result": again})
    assert printed.getvalue()
    if isinstance(result, PhosphorResult):
        for part in result.parts.values():
            assert_read_back(part)


def _no_number(text: str) -> float:
    raise AssertionError(f"{text} is no JSON")


def _assert_same(one: Any, other: Any, place: str) -> None:
    if isinstance(other, np.ndarray):
        assert one.dtype == other.dtype, place
        np.testing.assert_array_equal(one, other, err_msg=place)
    elif isinstance(other, Mapping):
        assert list(one) == list(other), place
        for key in other:
            _assert_same(one[key], other[key], f"{place}.{key}")
    elif isinstance(other, tuple):
        assert len(one) == len(other), place
        for number, (mine, its) in enumerate(zip(one, other, strict=True)):
            _assert_same(mine, its, f"{place}[{number}]")
    elif is_dataclass(other):
        assert isinstance(one, type(other)), place
        for field in fields(other):
            mine, its = getattr(one, field.name), getattr(other, field.name)
            _assert_same(mine, its, f"{place}.{field.name}")
    else:
        np.testing.assert_equal(one, other, err_msg=place)
