"""Protocol files of tests: written, planned, compared with the agreed timeline, refused."""

from pathlib import Path
from typing import Any

import pytest

from labrig.acquire import Plan, plan, read_protocol, read_rig_file
from labrig.foundation import resources
from labrig.foundation.errors import UsageError
from tests.quick_yaml import write_quickly


def written(folder: Path, **keys: Any) -> Path:
    """Write a protocol file of these keys."""
    path = folder / "protocol.yaml"
    path.write_text(write_quickly(keys))
    return path


def planned(protocol: Path, rig: str | Path) -> Plan:
    """Plan a protocol file on a shipped rig, or on that of a file."""
    path = resources.find("config", "rig", rig)
    return plan(read_protocol(protocol), read_rig_file(path), str(path))


def assert_timeline_as_agreed(name: str, rig: str) -> None:
    """The plan of a shipped protocol is what the file beside this one says."""
    lines = planned(resources.find("protocols", "protocol", name), rig).lines()
    golden = Path(__file__).parent / f"{name}.timeline.txt"
    assert "\n".join(lines) + "\n" == golden.read_text(encoding="utf-8")


def assert_one_clear_line(path: Path, said: str) -> None:
    """A protocol file is refused in one line that names it and says this."""
    with pytest.raises(UsageError) as caught:
        read_protocol(path)
    refusal = str(caught.value)
    assert refusal.startswith(f"{path}: "), refusal
    assert said in refusal
    assert "\n" not in refusal
