"""Differences between two results of a run, in lines for people."""

import filecmp
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from labrig.foundation.errors import DataError, LabrigError, UsageError
from labrig.foundation.input_file import MAX_JSON_BYTES, read_text
from labrig.foundation.number_format import plus_minus, rounded
from labrig.foundation.yaml_file import read_yaml
from labrig.process.provenance import PROVENANCE
from labrig.results import FittedDecay, find_fitted_decays, read_fitted_decay

#: Largest number of changed files that are named.
MAX_FILES = 6
#: Relative difference of two numbers that are the same but for rounding.
ROUNDING = 1e-9
#: Fraction of σ below which the change of a parameter, or of its σ, is not reported.
REPORTED_SIGMAS = 0.01

Parameters = dict[str, tuple[float, float]]


@dataclass(frozen=True)
class _Move:
    """A parameter in two fits, with its value and σ in each."""

    name: str
    before: tuple[float, float]
    after: tuple[float, float]

    @property
    def in_sigma(self) -> float:
        """Change of the value in units of the earlier σ, else the later; infinite if both are 0."""
        moved, sigma = self.after[0] - self.before[0], self.before[1] or self.after[1]
        if moved == 0:
            return 0.0
        return moved / sigma if sigma > 0 else math.copysign(math.inf, moved)

    @property
    def is_notable(self) -> bool:
        """Whether value or σ changed by more than rounding."""
        resized = not math.isclose(self.before[1], self.after[1], rel_tol=REPORTED_SIGMAS)
        return resized or abs(self.in_sigma) >= REPORTED_SIGMAS

    def __str__(self) -> str:
        """Return text such as `k_r 1 0.0320 ± 0.0001 → 0.0321 ± 0.0001 (+1.0 σ)`."""
        moved = f"{self.in_sigma:+.2g}".replace("-", "−")
        by = f" ({moved} σ)" if math.isfinite(self.in_sigma) else ""
        return f"{self.name} {plus_minus(*self.before)} → {plus_minus(*self.after)}{by}"


def changes(before: Path, after: Path) -> tuple[str, ...]:
    """Return the differences of the result folder `after` from `before`; empty if there are none.

    Files that exist in `before` only, where a person may have put them, do not count.
    """
    files = sorted(path.relative_to(after) for path in after.rglob("*") if path.is_file())
    changed_files = [file for file in files if not _same_content(before / file, after / file)]
    if not changed_files:
        return ()
    settings = other_settings(before, after)
    numbers = list(_parameter_changes(_fits(before), _fits(after)))
    if not numbers:
        numbers = list(_other_changes(before, after))
    if not numbers:
        numbers = [f"the numbers are the same; other in {_listed(changed_files)}"]
    elif not settings:
        numbers.append("nothing that is recorded explains it: labrig's code, or the computer?")
    return (*settings, *numbers)


def other_settings(before: Path, after: Path) -> tuple[str, ...]:
    """List the settings in which two results of a run differ.

    Parameters
    ----------
    before
        Folder of the earlier result, with its `provenance.yaml`.
    after
        Folder of the later result.

    Returns
    -------
    tuple of str
        A line for each setting, with its earlier and its later value.

    Examples
    --------
    >>> import shutil
    >>> from pathlib import Path
    >>> from labrig.analyse import Overrides
    >>> from labrig.process import other_settings, process_run
    >>> _ = shutil.copytree("runs/decay", "trials/one-state")
    >>> _ = process_run("trials/one-state", Overrides(options={"states": 1}))
    >>> other_settings(Path("runs/decay/result"), Path("trials/one-state/result"))
    ('states: auto → 1',)
    """
    return tuple(_other_settings(_settings(before), _settings(after)))


def _listed(files: Sequence[Path]) -> str:
    named = ", ".join(map(str, files[:MAX_FILES]))
    more = len(files) - MAX_FILES
    return f"{named} and {more} more" if more > 0 else named


def _other_changes(before: Path, after: Path) -> Iterator[str]:
    """Yield how many numbers of the results differ, and which one most, in proportion."""
    old, new = (dict(_numbers(_result(folder), "")) for folder in (before, after))
    if not old or not new:
        return
    if len(old) != len(new):
        yield f"{len(old)} numbers → {len(new)} numbers"
    ratios = {
        name: abs(new[name] - value) / max(abs(new[name]), abs(value))
        for name, value in old.items()
        if name in new and not math.isclose(new[name], value, rel_tol=ROUNDING)
    }
    if ratios:
        most = max(ratios, key=lambda name: ratios[name])
        yield (
            f"{len(ratios)} of {len(old)} numbers differ, most{most}: {rounded(old[most], 5)} → "
            f"{rounded(new[most], 5)}"
        )


def _result(folder: Path) -> Any:
    try:
        return json.loads(read_text(folder / "result.json", MAX_JSON_BYTES))
    except (LabrigError, ValueError, RecursionError):
        return None


def _numbers(content: Any, place: str) -> Iterator[tuple[str, float]]:
    """Yield all finite numbers of a result by their places, as words."""
    if isinstance(content, dict):
        for key, value in content.items():
            yield from _numbers(value, f"{place} {key}")
    elif isinstance(content, list):
        for number, value in enumerate(content, start=1):
            yield from _numbers(value, f"{place} {number}")
    elif isinstance(content, float) and math.isfinite(content):
        yield place, content


def _same_content(first: Path, second: Path) -> bool:
    return first.is_file() and filecmp.cmp(first, second, shallow=False)


def _settings(result: Path) -> dict[str, str]:
    """Return the content of `provenance.yaml` with one text per key; empty if there is none."""
    try:
        content = read_yaml(result / PROVENANCE)
        content.pop("journal", None)  # of the run, not of its processing
        content.pop("given", None)  # shows in the settings that were used
        content |= content.pop("options", None) or {}
        return dict(_flattened(content, ""))
    except UsageError:
        return {}


def _flattened(content: Mapping[str, Any], place: str) -> Iterator[tuple[str, str]]:
    for key, value in content.items():
        if isinstance(value, dict):
            yield from _flattened(value, f"{place}{key} ")
        elif isinstance(value, list):
            yield f"{place}{key}", ", ".join(map(str, value)) or "none"
        else:
            yield f"{place}{key}", "none" if value is None else str(value)


def _other_settings(before: Mapping[str, str], after: Mapping[str, str]) -> Iterator[str]:
    if not before:
        yield "the libraries of the earlier result are not recorded"
        return
    for key in dict.fromkeys([*before, *after]):
        old, new = before.get(key, "none"), after.get(key, "none")
        if old != new:
            yield f"{key}: {old} → {new}"


def _fits(result: Path) -> dict[str, Parameters]:
    """Return the parameters of each patch's fit by patch; fits that cannot be read are left out."""
    fits = {}
    for name, path in find_fitted_decays(result).items():
        with suppress(DataError):
            fits[name] = _parameters_of_charge(path) or _parameters(read_fitted_decay(path))
    return fits


def _parameters_of_charge(path: Path) -> Parameters:
    """Return value and σ of every parameter of a fit to charge and decay; none of other fits."""
    try:
        content = json.loads(read_text(path, MAX_JSON_BYTES))
    except (LabrigError, ValueError, RecursionError):
        return {}
    if content.get("kind") != "charge":
        return {}
    symbols = {"order": "b", "amplitude": "a", "rate_at_off_per_s": "p/τ"}
    named = {
        f"{symbol} {number}": state[name]
        for number, state in enumerate(content["states"], start=1)
        for name, symbol in symbols.items()
    }
    return {
        name: (each["value"], math.inf if each["sigma"] is None else each["sigma"])
        for name, each in named.items()
    }


def _parameters(fit: FittedDecay) -> Parameters:
    """Return value and σ of every parameter of a fit by name."""
    parameters: dict[str, tuple[float, float]] = {}
    for number, state in enumerate(fit.states, start=1):
        parameters[f"k_r {number}"] = state.k_r_per_s, state.k_r_per_s_sigma
        parameters[f"a {number}"] = state.amplitude, state.amplitude_sigma
    for name, values, sigmas in (
        ("weight", fit.channel_weights, fit.channel_weights_sigma),
        ("offset", fit.offsets, fit.offsets_sigma),
    ):
        for channel, value, sigma in zip(fit.channels, values, sigmas, strict=True):
            parameters[f"{name} {channel}"] = value, sigma
    parameters["flicker"] = fit.flicker, fit.flicker_sigma
    return parameters


def _parameter_changes(
    before: Mapping[str, Parameters], after: Mapping[str, Parameters]
) -> Iterator[str]:
    for patch in dict.fromkeys([*before, *after]):
        prefix = f"{patch}: " if patch else ""
        old, new = before.get(patch), after.get(patch)
        if old is None or new is None:
            yield f"{prefix}{'not fitted before' if old is None else 'fitted before, not now'}"
        elif old.keys() != new.keys():
            yield f"{prefix}{_states_text(old)} → {_states_text(new)}"
        else:
            moves = [_Move(name, old[name], new[name]) for name in old]
            moves = [move for move in moves if move.is_notable]
            if moves:
                yield prefix + "; ".join(_move_texts(moves))
            elif old != new:
                yield f"{prefix}every parameter within {REPORTED_SIGMAS:g} σ"


def _move_texts(moves: list[_Move]) -> Iterator[str]:
    """Yield rates, amplitudes and held parameters one by one and the others in one line."""
    others = []
    for move in moves:
        if move.name.startswith(("k_r", "a ", "p/τ ")) or math.isinf(move.in_sigma):
            yield str(move)
        else:
            others.append(move)
    if others:
        largest = max(others, key=lambda move: abs(move.in_sigma))
        furthest = rounded(abs(largest.in_sigma), 2)
        yield f"{', '.join(move.name for move in others)} by at most {furthest} σ"


def _states_text(parameters: Parameters) -> str:
    """Return text such as `2 states (k_r 0.3 ± 0.1, 0.01 ± 0.001 1/s)`."""
    symbol = "p/τ" if "p/τ 1" in parameters else "k_r"
    each = [plus_minus(*pair) for name, pair in parameters.items() if name.startswith(symbol)]
    return f"{len(each)} state{'s' if len(each) > 1 else ''} ({symbol} {', '.join(each)} 1/s)"
