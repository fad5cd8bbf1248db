"""The measurements of other people that lie in this repository: whose they are, and unchanged."""

import csv
from hashlib import sha256
from pathlib import Path


def test_every_measurement_is_the_file_that_its_provenance_says(real_data: Path) -> None:
    with (real_data / "PROVENANCE.csv").open(encoding="utf-8", newline="") as file:
        listed = {row["path"]: row["sha256"] for row in csv.DictReader(file)}
    there = {
        path.relative_to(real_data).as_posix(): sha256(path.read_bytes()).hexdigest()
        for path in real_data.glob("*/**/*")
        if path.is_file() and not path.name.startswith(("LICENSE", "NOTICE"))
    }
    assert there == listed


def test_every_folder_has_its_licence_and_all_are_small(real_data: Path) -> None:
    for folder in (path for path in real_data.iterdir() if path.is_dir()):
        assert [*folder.glob("LICENSE*"), *folder.glob("NOTICE*")], folder.name
        assert f"`{folder.name}`" in (real_data / "README.md").read_text("utf-8")
    assert sum(path.stat().st_size for path in real_data.rglob("*")) < 10e6
