"""Folders and modules of the user's own, named like labrig's, change nothing."""

import subprocess
import sys
from pathlib import Path

import pytest

from labrig import shipped

NOTEBOOK = """
import sys
sys.path.insert(0, {folder!r})
{before}
import labrig
from labrig import shipped
from labrig.acquire import plugins
for module in ("sim", "drivers.numato", "protocols.decay"):
    loaded = shipped.load(module)
    assert "trap" not in vars(loaded), module
for group in (plugins.DRIVERS, plugins.PROTOCOLS):
    for name in plugins.names(group):
        plugins.load(group, name, "test")
path = shipped.find("config", "rig", "sim")
assert path.read_text().startswith("# The simulated rig"), path
import sim, config
assert sim.trap and config.trap, "the user's own modules stay importable"
print("fine")
"""


@pytest.mark.parametrize("before", ["", "import sim, config, drivers, protocols"])
@pytest.mark.parametrize("as_folders", [True, False])
def test_a_users_own_modules_neither_replace_ours_nor_break_anything(
    tmp_path: Path, before: str, as_folders: bool
) -> None:
    for name in ("sim", "config", "drivers", "protocols"):
        if as_folders:
            (tmp_path / name).mkdir()
            (tmp_path / name / "__init__.py").write_text("trap = True\n")
            (tmp_path / name / "sim.yaml").write_text("a trap\n")
        else:
            (tmp_path / f"{name}.py").write_text("trap = True\n")
    done = subprocess.run(
        [sys.executable, "-c", NOTEBOOK.format(folder=str(tmp_path), before=before)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stdout.strip() == "fine", done.stderr


def test_what_is_not_shipped_is_not_loaded() -> None:
    with pytest.raises(ModuleNotFoundError, match="not shipped"):
        shipped.load("numpy")
    with pytest.raises(ModuleNotFoundError):
        shipped.load("drivers.teleporter")
