"""Export of a run to a Tiled server (blueskyproject.io/tiled)."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from labrig.export.dataset import dataset_of
from labrig.foundation.errors import UsageError
from labrig.record import Document, read_journal, read_run
from labrig.results import read_result

if TYPE_CHECKING:
    from tiled.client.container import Container


def to_tiled(run: Path | str, client: "Container") -> list[str]:
    """Write a run to a Tiled server.

    Every attempt that has ended becomes a BlueskyRun under its uid, with frames, actions and
    temperatures as its streams; attempts that the server has already are left alone. The latest
    result, if there is one, becomes an xarray Dataset under the run folder's name and replaces an
    earlier one there. The frames stay in the run folder.

    Parameters
    ----------
    run
        Run folder.
    client
        Client from `tiled.client.from_uri`, with permission to write and to delete.

    Returns
    -------
    list of str
        Uids of the attempts that were written.

    Raises
    ------
    UsageError
        If bluesky-tiled-plugins is not installed.
    DataError
        If this is not a run folder, or if it was changed.

    Examples
    --------
    >>> import labrig
    >>> [attempt.unit for attempt in labrig.read_run("runs/decay").attempts]
    ['dark', 'meter', 'decay-1']
    >>> from tiled.client import from_uri  # doctest: +SKIP
    >>> len(labrig.to_tiled("runs/decay", from_uri("http://127.0.0.1:8000")))  # doctest: +SKIP
    3
    """
    try:
        from bluesky_tiled_plugins import TiledWriter
        from tiled.client.xarray import write_xarray_dataset
    except ImportError:
        raise UsageError(
            "Tiled needs bluesky-tiled-plugins, which is not installed; install it with: "
            "python -m pip install 'labrig[tiled]'"
        ) from None
    folder = Path(run).resolve()
    ended = [
        attempt.uid for attempt in read_run(folder).attempts if attempt.exit_status is not None
    ]
    missing = [uid for uid in ended if not _is_complete(uid, client)]
    _delete([uid for uid in missing if uid in client], client)
    writer = TiledWriter(client)
    for uid, (name, doc) in _by_attempt(read_journal(folder / "journal.jsonl").documents):
        if uid in missing:
            writer(name, doc)
    if (folder / "result").is_dir():
        _delete([folder.name] if folder.name in client else [], client)
        write_xarray_dataset(client, dataset_of(read_result(folder)), key=folder.name)
    return missing


def _is_complete(uid: str, client: "Container") -> bool:
    """Whether the server has the attempt to its end; an upload may have been interrupted."""
    return uid in client and "stop" in client[uid].metadata


def _delete(keys: list[str], client: "Container") -> None:
    if keys:
        client.delete_contents(keys, recursive=True, external_only=False)


def _by_attempt(documents: list[Document]) -> Iterator[tuple[str, Document]]:
    """Yield each document with the uid of its attempt."""
    attempts: dict[str, str] = {}
    for name, doc in documents:
        if name == "start":
            uid = doc["uid"]
        elif name == "event":
            uid = attempts[doc["descriptor"]]
        else:
            uid = doc["run_start"]
            attempts[doc["uid"]] = uid
        yield uid, (name, doc)
