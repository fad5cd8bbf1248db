"""Every part of labrig has one import name, and modules of the user's own change nothing."""

import importlib
import subprocess
import sys
from importlib.metadata import distribution, entry_points
from pathlib import Path

import pytest

from labrig.drivers.numato import Numato
from labrig.foundation import plugins

FOLDERS = ("drivers", "protocols", "sim", "config")
NOTEBOOK = """
import sys
sys.path.insert(0, {folder!r})
{before}
import labrig
from labrig.foundation import resources
from labrig.bench import opening as bench
from labrig.foundation import plugins
import labrig.drivers.numato, labrig.protocols.decay.protocol, labrig.sim
for module in (labrig.drivers, labrig.protocols, labrig.sim):
    assert "trap" not in vars(module), module
for name in plugins.names(plugins.DRIVERS):
    plugins.load(plugins.DRIVERS, name, "test")
for _, registered in plugins.measurements():
    for part in ("protocol", "analysis", "result", "report", "calibration"):
        registered.load(part)
path = resources.find("config", "rig", "sim")
assert path.read_text().startswith("# The simulated rig"), path
import sim, config
assert sim.trap and config.trap, "the user's own modules stay importable"
print("fine")
"""


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("before", "as_folders"), [("", True), ("import sim, config, drivers, protocols", False)]
)
def test_a_users_own_modules_neither_replace_ours_nor_break_anything(
    tmp_path: Path, before: str, as_folders: bool
) -> None:
    for name in FOLDERS:
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


def test_a_class_is_one_object_by_every_road() -> None:
    (entry,) = entry_points(group=plugins.DRIVERS, name="numato")
    by_name = importlib.import_module("labrig.drivers.numato").Numato
    by_rig_file = plugins.load(plugins.DRIVERS, "numato", "test")
    assert Numato is by_name is by_rig_file is entry.load()
    assert Numato.__module__.startswith("labrig.drivers.numato")


@pytest.mark.parametrize("folder", FOLDERS)
def test_another_name_for_a_part_is_refused(folder: str) -> None:
    # Tests run in the repository, where the folders lie on the import path.
    with pytest.raises(ImportError, match=f"labrig.{folder}"):
        importlib.import_module(folder)


def test_the_installation_offers_one_top_level_name() -> None:
    files = distribution("labrig").files or []
    packages = {file.parts[0] for file in files if file.suffix == ".py" and len(file.parts) > 1}
    assert packages <= {"labrig"}
    assert not any(name in FOLDERS for name in packages)
