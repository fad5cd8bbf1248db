"""Packages that labrig puts in place: they install, are found, and pass their own tests."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from labrig.foundation import resources
from labrig.foundation.errors import UsageError
from labrig.package_template import create_package
from tests.conftest import Ended

Labrig = Callable[..., Ended]
BUILD = """
import sys, zipfile
from pathlib import Path
from hatchling.build import build_wheel
place = Path(sys.argv[1])
zipfile.ZipFile(place / build_wheel(place)).extractall(place)
"""


def installed(package: Path, place: Path) -> dict[str, str]:
    """The environment in which a package is installed in `place`, as pip does it, without pip."""
    place.mkdir()
    building = [sys.executable, "-c", BUILD, str(place)]
    subprocess.run(building, cwd=package, check=True, capture_output=True)
    # Plugins of pytest, which the package does not need, take as long as its tests.
    return os.environ | {"PYTHONPATH": str(place), "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("words", "name"),
    [(("driver", "new"), "acme_relay"), (("protocol", "new", "--python"), "quick_look")],
)
def test_a_new_package_passes_its_own_test(
    labrig: Labrig, tmp_path: Path, words: tuple[str, ...], name: str
) -> None:
    folder = tmp_path / name
    ended = labrig(*words, name, folder)
    assert (ended.code, ended.err) == (0, "")
    assert str(folder) in ended.out
    written = [path for path in folder.rglob("*") if path.is_file()]
    for path in written:
        assert "my_" not in path.read_text(encoding="utf-8") + path.name
    environment = installed(folder, tmp_path / "site")
    tested = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-W", "error", folder],
        cwd=folder, env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert tested.returncode == 0, tested.stdout + tested.stderr
    before = {path: path.read_bytes() for path in written}
    ended = labrig(*words, name, folder)
    assert ended.code == 2
    assert "is there already" in ended.err
    assert {path: path.read_bytes() for path in written} == before


@pytest.mark.parametrize("kind", ["driver", "protocol"])
@pytest.mark.parametrize(
    "name", ["", "Relay", "my-relay", "1relay", "class", "a__b", "../relay", "é"]
)
def test_a_name_that_is_no_modules_is_one_line(
    labrig: Labrig, tmp_path: Path, kind: str, name: str
) -> None:
    words = (kind, "new", *(["--python"] if kind == "protocol" else []))
    ended = labrig(*words, "--", name, tmp_path / "new")
    assert ended.code == 2
    (line,) = ended.err.splitlines()
    assert f"{name!r} cannot be the name of a {kind}" in line
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize("name", ["numato", "json", "numpy", "labrig"])
def test_a_name_in_use_is_one_line(labrig: Labrig, tmp_path: Path, name: str) -> None:
    ended = labrig("driver", "new", name, tmp_path / "new")
    assert ended.code == 2
    (line,) = ended.err.splitlines()
    assert "is in use" in line


def test_a_folder_that_cannot_be_written_is_one_line(labrig: Labrig, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    ended = labrig("driver", "new", "acme_relay", tmp_path / "file" / "new")
    assert ended.code == 5
    assert len(ended.err.splitlines()) == 1


@given(st.text(max_size=12))
def test_any_name_makes_a_module_or_is_refused(
    tmp_path_factory: pytest.TempPathFactory, name: str
) -> None:
    folder = tmp_path_factory.mktemp("new") / "package"
    try:
        create_package("driver", name, folder)
    except UsageError as error:
        assert len(str(error).splitlines()) <= 1
    else:
        assert name.isidentifier()
        assert (folder / name / "driver.py").is_file()


def test_templates_are_shipped() -> None:
    names = {path.name for path in resources.folder("config/templates").rglob("*.toml")}
    assert names == {"pyproject.toml"}
