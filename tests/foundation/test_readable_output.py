"""Output in encodings that lack its characters, and names that are no text: nothing fails."""

import json
import os
import subprocess
import sys
import unicodedata
from collections.abc import Callable
from io import BytesIO, TextIOWrapper
from pathlib import Path

import pytest
import typer
from hypothesis import given, strategies as st
from rich.console import Console

from labrig.foundation.readable_output import make_streams_readable, spelled
from labrig.record import RunFolder
from tests.conftest import Ended

ENCODINGS = ["ascii", "cp1252", "cp437", "cp850", "latin-1", "gbk", "utf-8"]
#: Output and input as under `LC_ALL=C`, where file names are ASCII, too.
PLAIN_C = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
COLUMNS = "time_s,σ (s⁻¹)\n" + "".join(f"{t},{1000 * 0.9**t:.4f}\n" for t in range(40))


@pytest.mark.parametrize(
    ("text", "encoding", "expected"),
    [
        ("σ = (2.0 ± 0.1) s⁻¹", "ascii", "sigma = (2.0 +- 0.1) s^-1"),
        ("σ = (2.0 ± 0.1) s⁻¹", "cp1252", "sigma = (2.0 ± 0.1) s^-1"),
        ("σ = (2.0 ± 0.1) s⁻¹", "cp437", "σ = (2.0 ± 0.1) s^-1"),
        ("3 · 10¹⁵ W m⁻² sr⁻¹", "latin-1", "3 · 10^15 W m^-2 sr^-1"),
        ("10² s, 10¹⁵ s", "cp1252", "10² s, 10^15 s"),
        ("reduced χ² ≤ 1.2 …", "ascii", "reduced chi^2 <= 1.2 ..."),
        ("5 µm → 6 μm, 45°, − 1", "ascii", "5 um -> 6 um, 45deg, - 1"),
        ("λ, Λ, Δκ, k₁, é, Å, ½", "ascii", "lambda, Lambda, Deltakappa, k1, e, A, 1/2"),
        ("“batch” – 3", "ascii", '"batch" - 3'),
        ("样品 😀", "ascii", r"\u6837\u54c1 \U0001f600"),
        ("caf\udce9.csv", "utf-8", r"caf\xe9.csv"),
    ],
)
def test_what_an_encoding_lacks_is_spelled(text: str, encoding: str, expected: str) -> None:
    assert spelled(text, encoding) == expected


@given(st.text(st.characters(exclude_categories=[])), st.sampled_from(ENCODINGS))
def test_any_text_becomes_one_that_the_encoding_has(text: str, encoding: str) -> None:
    written = spelled(text, encoding)
    written.encode(encoding)
    assert spelled(written, encoding) == written
    if text.isascii():
        assert written == text


def test_all_letters_of_formulas_are_spelled_in_words() -> None:
    letters = (chr(code) for code in range(0x391, 0x3CA))
    for letter in filter(str.isalpha, letters):
        name = spelled(letter, "ascii")
        assert name.isalpha()
        assert name[0].isupper() == (unicodedata.category(letter) == "Lu")


def command(
    arguments: list[str | bytes], folder: Path, variables: dict[str, str]
) -> "subprocess.CompletedProcess[bytes]":
    return subprocess.run(
        [sys.executable, "-m", "labrig", *arguments],
        cwd=folder,
        env={**os.environ, **variables},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        check=False,
    )


@pytest.mark.parametrize("encoding", ["ascii", "cp1252", "utf-8", "utf-16"])
def test_all_ways_of_printing_spell(encoding: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Command line libraries write UTF-8 past a stream that says it is ASCII."""
    texts = "σ = 2 s⁻¹", "样品 \udcff"
    streams = {
        name: TextIOWrapper(BytesIO(), encoding, errors="strict", write_through=True)
        for name in ("stdout", "stderr")
    }
    for name, stream in streams.items():
        monkeypatch.setattr(sys, name, stream)
    monkeypatch.setattr(sys, "stdin", TextIOWrapper(BytesIO(b"a\xff\n"), "utf-8"))
    make_streams_readable()
    for name, stream in streams.items():
        print(texts[0], file=stream)
        typer.echo(texts[1], err=name == "stderr")
        Console(file=stream).print(texts[0])
        written = stream.buffer.getvalue().decode(encoding)
        expected = [texts[0], texts[1], texts[0]]
        assert written.split("\n") == [*(spelled(text, encoding) for text in expected), ""]
    assert sys.stdin.readline() == "a\\xff\n"


def test_a_command_ends_well_where_all_is_ascii(tmp_path: Path) -> None:
    (tmp_path / "decay.csv").write_text(COLUMNS, encoding="utf-8")
    ended = command(["fit", "decay", "decay.csv"], tmp_path, PLAIN_C)
    assert ended.returncode == 0, ended.stderr
    assert "state  k / s^-1" in (ended.stdout + ended.stderr).decode("ascii")


def test_what_programs_read_is_the_same_in_any_encoding(
    labrig: Callable[..., Ended], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A spelled character would be no JSON, or another text."""
    monkeypatch.chdir(tmp_path)
    queue = "runs: [{protocol: decay, set: {sample.name: '样品 😀 σ'}}]"
    Path("queue.yaml").write_text(queue, encoding="utf-8")
    ended = labrig("queue", "list", "--json")
    assert ended.out.isascii()
    assert json.loads(ended.out)[0]["set"] == {"sample.name": "样品 😀 σ"}


@pytest.mark.skipif(sys.platform != "linux", reason="names of files are text elsewhere")
def test_a_name_that_is_no_text_is_told(tmp_path: Path) -> None:
    name = os.fsdecode(b"caf\xe9")
    folder = tmp_path / name
    folder.mkdir()
    (folder / "mine.yaml").write_text("protocol: decay\nchrge: 5 min\n", encoding="utf-8")
    ended = command(["plan", "./mine.yaml", "--rig", "sim"], folder, {})
    assert ended.returncode == 2
    assert b"did you mean 'charge'" in ended.stderr
    ended = command([b"plan", os.fsencode(f"{name}/mine.yaml")], tmp_path, {})
    assert (ended.returncode, ended.stderr.count(b"\n")) == (2, 1)
    assert rb"caf\udce9" in ended.stderr


@pytest.mark.parametrize(
    ("name", "part"), [("decay_" + "样" * 80, "样"), ("decay_...", "decay"), ("σ/😀\0..", "σ")]
)
def test_any_sample_has_a_run_folder(tmp_path: Path, name: str, part: str) -> None:
    with RunFolder.create(tmp_path, name, 1_767_225_600.0, {}, 1) as folder:
        assert part in folder.path.name
        assert len(os.fsencode(folder.path.name)) < 150
        assert not folder.path.name.endswith(".")


def test_a_rig_whose_path_is_no_text_is_refused_in_one_line(
    labrig: Callable[..., Ended],
    make_rig: Callable[..., Path],
    make_protocol: Callable[..., Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    if sys.platform != "linux":
        pytest.skip("names of files are text elsewhere")
    folder = tmp_path / os.fsdecode(b"caf\xe9")
    folder.mkdir()
    rig = make_rig(f"{folder.name}/rig.yaml")
    runs = tmp_path / "runs"
    content = rig.read_text(encoding="utf-8")
    rig.write_text(content.replace("optics:\n", "optics:\n  direct: run-1\n"), encoding="utf-8")
    monkeypatch.chdir(folder)
    ended = labrig("run", make_protocol(), "--rig", "./rig.yaml", "--runs", runs)
    assert ended.code == 2
    assert "caf\\xe9" in ended.err
    assert ended.err.count("\n") == 1
    assert not list(runs.glob("*"))
