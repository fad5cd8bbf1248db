"""A run in a Tiled server (blueskyproject.io/tiled), where other programs find and read it."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from labrig.errors import UsageError
from labrig.export.dataset import read_dataset
from labrig.record import Document, read_journal, read_run

if TYPE_CHECKING:
    from tiled.client.container import Container


def to_tiled(run: Path | str, client: "Container") -> list[str]:
    """Write the run in folder `run` to a Tiled server; its frames stay where they are.

    Every attempt that has ended becomes a BlueskyRun under its uid, with frames and actions as its
    streams; those that are there already are left alone. The latest result, if there is one,
    becomes an xarray Dataset under the run folder's name, in place of an earlier one there.

    Parameters
    ----------
    client
        From `tiled.client.from_uri`, allowed to write and to delete.

    Returns
    -------
    list of str
        Uids of the attempts that were written.

    Raises
    ------
    UsageError
        bluesky-tiled-plugins is not installed.
    DataError
        Not a run folder, or one that was changed.
    """
    try:
        from bluesky_tiled_plugins import TiledWriter
        from tiled.client.xarray import write_xarray_dataset
    except ImportError:
        raise UsageError(
            "Tiled needs bluesky-tiled-plugins, which is not installed; install it with: "
            "python -m pip install bluesky-tiled-plugins xarray"
        ) from None
    folder = Path(run).resolve()
    ended = [a.uid for a in read_run(folder).attempts if a.exit_status is not None]
    wanted = [uid for uid in ended if not _is_whole(uid, client)]
    _delete([uid for uid in wanted if uid in client], client)
    writer = TiledWriter(client)
    for uid, (name, doc) in _by_attempt(read_journal(folder / "journal.jsonl").documents):
        if uid in wanted:
            writer(name, doc)
    if (folder / "result").is_dir():
        _delete([folder.name] if folder.name in client else [], client)
        write_xarray_dataset(client, read_dataset(folder), key=folder.name)
    return wanted


def _is_whole(uid: str, client: "Container") -> bool:
    """Whether the server has that attempt to its end: writing it may have been cut off."""
    return uid in client and "stop" in client[uid].metadata


def _delete(keys: list[str], client: "Container") -> None:
    if keys:
        client.delete_contents(keys, recursive=True, external_only=False)


def _by_attempt(documents: list[Document]) -> Iterator[tuple[str, Document]]:
    """Each document with the uid of its attempt."""
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
