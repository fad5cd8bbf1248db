"""The queue's file: measurements to be made, values of their keys, and the runs made of them."""

from collections.abc import Callable, Iterable
from itertools import product
from pathlib import Path
from typing import Any

from pydantic import Field

from labrig.foundation.errors import DiskError, UsageError
from labrig.foundation.file_kind import QUEUE, require_kind
from labrig.foundation.file_lock import plain_lock
from labrig.foundation.models import FrozenModel
from labrig.foundation.output_file import write_text
from labrig.foundation.yaml_file import parse_yaml, read_model, yaml_text


class QueuedRun(FrozenModel):
    """A measurement of a queue.

    Attributes
    ----------
    protocol
        Name of a shipped protocol, or path of its file.
    rig
        Name or path of the rig file; null for the default rig.
    changes
        Values of the protocol's keys instead of those in its file, by dotted keys such as
        `charge` or `sample.name`; `set` in the file.
    run
        Name of the run folder; null before the run.
    """

    protocol: str
    rig: str | None = None
    changes: dict[str, Any] = Field(default_factory=dict, alias="set")
    run: str | None = None


class Queue(FrozenModel):
    """Measurements in the order in which they are made.

    Attributes
    ----------
    runs
        The measurements.
    """

    runs: tuple[QueuedRun, ...] = ()


def read_queue(path: Path) -> Queue:
    """Read the file of a queue.

    Parameters
    ----------
    path
        YAML file with the key `runs`.

    Returns
    -------
    Queue
        The queue.

    Raises
    ------
    UsageError
        There is no such file, or it is malformed.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.queue import read_queue
    >>> _ = Path("queue.yaml").write_text("runs: [{protocol: decay, set: {charge: 5 min}}]")
    >>> read_queue(Path("queue.yaml")).runs[0].changes
    {'charge': '5 min'}
    """
    if not path.is_file():
        raise UsageError(f"{path}: no such queue; begin one with: labrig queue add PROTOCOL")
    require_kind(path, QUEUE)
    return read_model(path, Queue)


def change_queue(path: Path, change: Callable[[Queue], Queue]) -> Queue:
    """Replace a queue by what `change` makes of it, as one step for all processes.

    Parameters
    ----------
    path
        File of the queue; without one the queue is empty.
    change
        Function of the present queue.

    Returns
    -------
    Queue
        The queue as it is now.

    Raises
    ------
    UsageError
        The file is malformed.
    DiskError
        It cannot be written.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.queue import Queue, QueuedRun, change_queue
    >>> more = QueuedRun(protocol="decay", set={"charge": "5 min"})
    >>> queue = change_queue(Path("nights.yaml"), lambda queue: Queue(runs=(*queue.runs, more)))
    >>> len(queue.runs)
    1
    """
    if path.exists():
        read_queue(path)  # no lock is made beside a file that is none of ours
    try:
        with plain_lock(path.with_name(f".{path.name}.lock")):
            queue = change(read_queue(path) if path.exists() else Queue())
            runs = [
                run.model_dump(mode="json", by_alias=True, exclude_defaults=True)
                for run in queue.runs
            ]
            write_text(path, yaml_text({"runs": runs}))
    except OSError as error:
        raise DiskError(f"{path}: cannot be written ({error.strerror})") from None
    return queue


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
