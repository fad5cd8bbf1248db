"""Of what is recorded, the tests that ask whether it is on the disk."""

import pytest

from tests.conftest import SYNC


@pytest.fixture(autouse=True)
def synced(monkeypatch: pytest.MonkeyPatch) -> None:
    """Files are synced, as they are in the field."""
    monkeypatch.setattr("os.fsync", SYNC)
