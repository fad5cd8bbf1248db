"""Keys of a protocol and the values that they are to have, as typed at a terminal."""

from collections.abc import Iterable
from itertools import product
from typing import Any

from labrig.foundation.errors import UsageError
from labrig.foundation.yaml_file import parse_yaml


def combinations(settings: Iterable[str], sweeps: Iterable[str]) -> list[dict[str, Any]]:
    """Return the changes of a protocol's keys for each run of a parameter sweep.

    Parameters
    ----------
    settings
        Texts `KEY=VALUE`, for all runs; the value is YAML.
    sweeps
        Texts `KEY=VALUE, VALUE, …`; with several sweeps all combinations are run, the last one
        changing fastest.

    Returns
    -------
    list of dict
        Value by dotted key, for each run.

    Raises
    ------
    UsageError
        A text has another form, or names a key twice.

    Examples
    --------
    >>> from labrig.queue import combinations
    >>> combinations(["sample.name=paint"], ["charge=1 min, 5 min"])
    [{'sample.name': 'paint', 'charge': '1 min'}, {'sample.name': 'paint', 'charge': '5 min'}]
    """
    fixed = [_pair("--set", text) for text in settings]
    swept = [_pair("--sweep", text) for text in sweeps]
    keys = [key for key, _ in (*fixed, *swept)]
    for key in keys:
        if keys.count(key) > 1:
            raise UsageError(f"expected every key once, got '{key}' twice in --set and --sweep")
    same = {key: _value("--set", key, text) for key, text in fixed}
    lists = [[(key, value) for value in _values(key, text)] for key, text in swept]
    return [{**same, **dict(chosen)} for chosen in product(*lists)]


def _pair(option: str, text: str) -> tuple[str, str]:
    key, equals, value = text.partition("=")
    if not key.strip() or not equals or not value.strip():
        raise UsageError(f"{option}: expected KEY=VALUE, such as 'charge=5 min', got '{text}'")
    return key.strip(), value.strip()


def _value(option: str, key: str, text: str) -> Any:
    try:
        return parse_yaml(f"value: {text}", option)["value"]
    except (UsageError, KeyError):
        raise UsageError(f"{option} {key}: expected a value in YAML, got '{text}'") from None


def _values(key: str, text: str) -> list[Any]:
    listed = text if text.startswith("[") else f"[{text}]"
    values = _value("--sweep", key, listed)
    if not isinstance(values, list) or not values:
        raise UsageError(f"--sweep {key}: expected values between commas, got '{text}'")
    return values
