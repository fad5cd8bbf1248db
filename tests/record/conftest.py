"""Of what is recorded, the tests that ask whether it is on the disk."""

import pytest


@pytest.fixture(autouse=True)
def unsynced() -> None:
    """Files are synced, as they are in the field."""
