"""Size of a run folder: what is in it, counted once."""

from pathlib import Path

import pytest

from labrig.record import RunSize, size_text


def test_frames_and_all_else_add_up_to_what_lies_in_the_folder(tmp_path: Path) -> None:
    sizes = {
        "frames/1.dng": 1000, "frames/2.dng": 500, "journal.jsonl": 70, "result/report.html": 8,
        "result/frames/picture.png": 3,
    }  # fmt: skip
    for name, size_bytes in sizes.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(bytes(size_bytes))
    size = RunSize.measured(tmp_path)
    assert size == RunSize(2, 1500, 81)
    assert size.total_bytes == 1581


@pytest.mark.parametrize(
    ("size_bytes", "text"),
    [(1_570_000_000, "1.57 GB"), (152_460_000, "152 MB"), (20_000, "20 kB"), (400, "0 kB")],
)
def test_sizes_are_written_to_three_digits(size_bytes: int, text: str) -> None:
    assert size_text(size_bytes) == text
