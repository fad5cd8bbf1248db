"""Files that came to harm, read by the functions that read them: a value, or one line.

tests/acceptance/mutated_files.py has very many, and the whole commands.
"""

import random
from collections.abc import Callable
from pathlib import Path

import pytest

from labrig.acquire import read_protocol, read_rig_file
from labrig.foundation import resources
from labrig.foundation.errors import LabrigError
from labrig.material import read_material
from labrig.optics import read_curve_file
from labrig.record import RunFolder, read_run
from labrig.results import read_series
from tests.mutated_files import mutated

TIMES = 60
READERS: dict[str, Callable[[Path], object]] = {
    "protocols/decay/decay.yaml": read_protocol,
    "config/sim.yaml": read_rig_file,
    "config/materials/blue-paint.yaml": read_material,
    "config/optics/grey_card_18.csv": read_curve_file,
    "config/optics/cameras/canon_eos_5d_mark_ii.json": read_curve_file,
    "config/optics/halogen_3000k.csv": read_series,
}


@pytest.mark.parametrize("name", READERS)
def test_a_file_that_came_to_harm_is_read_or_refused_in_a_line(name: str, tmp_path: Path) -> None:
    place, _, file = name.rpartition("/")
    sound = (resources.folder(place) / file).read_bytes()
    harmed = tmp_path / file
    for number in range(TIMES):
        harmed.write_bytes(mutated(sound, random.Random(f"{name} {number}")))
        try:
            READERS[name](harmed)
        except LabrigError as error:
            assert len(str(error).splitlines()) == 1, number


def test_a_journal_that_came_to_harm_is_read_or_refused_in_a_line(tmp_path: Path) -> None:
    with RunFolder.create(tmp_path, "test", 1.8e9, {"protocol.yaml": "a: 1\n"}, 1) as folder:
        for unit in ("dark", "decay-1"):
            writer = folder.attempt(unit, lambda: 1.8e9, {"devices": {"camera": "a camera"}})
            writer.frame(
                b"x", ".dng", role=unit, exposure_s=1.0, iso=400, f_number=4.0,
                start_time=1.8e9, end_time=1.8e9, late_s=0.0,
            )  # fmt: skip
            writer.stop("success")
    journal = folder.path / "journal.jsonl"
    sound = journal.read_bytes()
    for number in range(4 * TIMES):
        journal.write_bytes(mutated(sound, random.Random(number)))
        try:
            with RunFolder(folder.path, 1) as again:
                again.close_open_attempts(lambda: 1.8e9, "abort", "crash")
            read_run(folder.path).completed()
        except LabrigError as error:
            assert len(str(error).splitlines()) == 1, number
