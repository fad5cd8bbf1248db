"""A working folder of somebody else: nothing in it is imported, or configures what labrig uses."""

import subprocess
import sys
from pathlib import Path

#: Modules that labrig imports, the first ones among them.
PLANTED = ("lazy_loader", "typer", "yaml", "numpy", "pydantic", "rich", "labrig_planted")


def test_nothing_planted_is_imported(tmp_path: Path) -> None:
    for name in PLANTED:
        (tmp_path / f"{name}.py").write_text("raise SystemExit('planted')\n")
    ended = subprocess.run(
        [sys.executable, "-m", "labrig", "protocol", "list"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (ended.returncode, ended.stderr) == (0, "")
    assert "decay" in ended.stdout


def test_a_configuration_of_numba_in_the_working_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / ".numba_config.yaml").write_text("cache_dir: planted\n")
    code = "from labrig.reproduce.compiled import compiled; compiled('surface.field_kernels')"
    ended = subprocess.run(
        [sys.executable, "-P", "-c", code],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert "UsageError: .numba_config.yaml: expected no configuration" in ended.stderr
    assert not (tmp_path / "planted").exists()
