"""A run in a Tiled server in this process: the same frames, the same numbers, written once.

The server brings 100 packages, so it is no dependency of the tests; to run this one:

    uv run --extra tiled --with "tiled[server]" pytest tests/export/test_tiled.py
"""

import json
import shutil
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

import labrig
from labrig.foundation.errors import UsageError
from labrig.record import read_run
from labrig.record.journal import read_journal
from tests.export.conftest import Finished

pytestmark = pytest.mark.filterwarnings("ignore")  # of the server's own packages
needs_server = pytest.mark.skipif(
    find_spec("tiled") is None or find_spec("fastapi") is None,
    reason="needs bluesky-tiled-plugins and tiled[server]",
)


@pytest.fixture
def client(tmp_path: Path) -> Iterator[Any]:
    from tiled.catalog import in_memory
    from tiled.client import Context, from_context
    from tiled.server.app import build_app

    storage = {"filesystem": f"file://localhost{tmp_path}", "sql": f"sqlite:///{tmp_path}/t.db"}
    with Context.from_app(build_app(in_memory(writable_storage=storage))) as context:
        yield from_context(context)


@needs_server
def test_the_server_has_every_frame_and_the_result(finished: Finished, client: Any) -> None:
    record = read_run(finished.folder)
    assert labrig.to_tiled(finished.folder, client) == [a.uid for a in record.attempts]
    for attempt in record.attempts:
        kept = client[attempt.uid]
        assert kept.metadata["start"] == attempt.start
        assert kept.metadata["stop"]["exit_status"] == "success"
        frames = kept["frames"].read()
        assert list(frames.frame.values) == [f"frames/{f.path.name}" for f in attempt.frames]
        assert list(frames.sha256.values) == [f.sha256 for f in attempt.frames]
        assert list(frames.start_time.values) == [f.start_time for f in attempt.frames]
    result = client[finished.folder.name].read()
    assert result.identical(labrig.read_result(finished.folder).to_xarray())


@needs_server
def test_what_is_there_is_left_and_what_was_cut_off_is_written_again(
    finished: Finished, client: Any, tmp_path: Path
) -> None:
    from bluesky_tiled_plugins import TiledWriter

    folder = shutil.copytree(finished.folder, tmp_path / finished.folder.name)
    documents = read_journal(folder / "journal.jsonl").documents
    writer = TiledWriter(client)
    for name, doc in documents[:5]:
        writer(name, doc)
    cut_off = documents[0][1]["uid"]
    assert "stop" not in client[cut_off].metadata
    assert cut_off in labrig.to_tiled(folder, client)
    assert client[cut_off].metadata["stop"]["exit_status"] == "success"

    path = folder / "result" / "fit.json"
    fit = json.loads(path.read_text()) | {"flicker": 0.25}
    path.write_text(json.dumps(fit))
    assert labrig.to_tiled(folder, client) == []
    assert client[folder.name].read().flicker.values.tolist() == [0.25]


def test_without_the_package_it_says_what_to_install(
    finished: Finished, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "bluesky_tiled_plugins", None)
    with pytest.raises(UsageError, match=r"pip install 'labrig\[tiled\]'"):
        labrig.to_tiled(finished.folder, client=None)
