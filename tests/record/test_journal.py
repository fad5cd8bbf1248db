"""The journal: durable lines, torn tails, damage."""

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, strategies as st

from labrig.foundation.errors import DataError
from labrig.record import sealed_line
from labrig.record.journal import Journal, read_journal

values = st.recursive(
    st.none() | st.booleans() | st.integers(-(10**12), 10**12) | st.floats(-1e9, 1e9) | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=5,
)
documents = st.lists(
    st.tuples(st.sampled_from(["start", "event"]), st.dictionaries(st.text(), values)), max_size=6
)


@given(written=documents, cut=st.integers(0, 10_000))
def test_whatever_is_cut_off_only_the_torn_line_is_lost(
    tmp_path_factory: pytest.TempPathFactory,
    written: list[tuple[str, dict[str, Any]]],
    cut: int,
) -> None:
    path = tmp_path_factory.mktemp("run") / "journal.jsonl"
    with Journal(path) as journal:
        for name, doc in written:
            journal.append(name, doc)
    assert read_journal(path).documents == written
    raw = path.read_bytes()
    kept = raw[: min(cut, len(raw))]
    path.write_bytes(kept)
    content = read_journal(path)
    assert content.documents == written[: kept.count(b"\n")]
    assert content.torn == (not kept.endswith(b"\n") and kept != b"")
    with Journal(path) as journal:
        journal.append("stop", {"after": "crash"})
    again = read_journal(path)
    assert again.documents == [*content.documents, ("stop", {"after": "crash"})]
    assert not again.torn


def test_each_line_is_on_the_disk_when_append_returns(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    with Journal(path) as journal:
        journal.append("start", {"uid": "1"})
        assert json.loads(path.read_bytes()) == {
            "name": "start", "doc": {"uid": "1"}, "after": "",
        }  # fmt: skip


def test_damage_before_the_last_line_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    path.write_bytes(sealed_line("start", {}, "") + b"rubbish\n" + sealed_line("stop", {}, ""))
    with pytest.raises(DataError, match="line 2"):
        read_journal(path)


def test_no_journal_is_reported(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no journal"):
        read_journal(tmp_path / "journal.jsonl")
