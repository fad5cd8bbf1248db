"""`labrig key`, `labrig seal` and `labrig verify`: whose run it is, and what was changed since."""

import json
import shutil
import stat
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
import typer
from hypothesis import given, strategies as st

from labrig.foundation.errors import DataError, UsageError
from labrig.record import read_run
from labrig.seal import create_key, read_key, read_signers, signature_text, signer_of
from tests.conftest import Ended
from tests.resealed import reseal

Labrig = Callable[..., Ended]
LAB = "Optics lab, Example University"


@pytest.fixture(autouse=True)
def settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Folder of this user's settings, empty."""
    folder = tmp_path / "settings" / "labrig"
    monkeypatch.setattr(typer, "get_app_dir", lambda name: str(folder))
    return folder


@pytest.fixture
def sealed(labrig: Labrig, finished: Path) -> Path:
    """A run that this laboratory has sealed."""
    assert labrig("key", "new", LAB).code == 0
    assert labrig("seal", finished).code == 0
    return finished


def status(labrig: Labrig, run: Path, *options: object) -> tuple[int, str, dict[str, object]]:
    ended = labrig("verify", run, "--json", *options)
    told = json.loads(ended.out)
    return ended.code, told["status"], told["seal"]


def test_a_key_is_made_once_and_read_by_nobody_else(labrig: Labrig, settings: Path) -> None:
    made = labrig("key", "new", LAB)
    assert made.code == 0
    key = settings / "seal_key"
    assert stat.S_IMODE(key.stat().st_mode) == 0o600
    public = (settings / "seal_key.pub").read_text()
    assert made.out == labrig("key", "show").out == public
    assert read_key(key).public.fingerprint in made.err
    again = labrig("key", "new", "another")
    assert (again.code, len(again.err.splitlines())) == (2, 1)
    key.chmod(0o644)
    refused = labrig("key", "show")
    assert refused.code == 2
    assert "chmod 600" in refused.err


def test_without_a_key_nothing_is_sealed(labrig: Labrig, finished: Path) -> None:
    assert labrig("key", "show").code == 2
    assert labrig("seal", finished).code == 2
    assert status(labrig, finished)[:2] == (0, "unsealed")


def test_who_sealed_a_run_is_named_where_the_key_is_known(
    labrig: Labrig, sealed: Path, settings: Path, tmp_path: Path
) -> None:
    fingerprint = read_key(settings / "seal_key").public.fingerprint
    code, said, seal = status(labrig, sealed)
    assert (code, said) == (0, "sealed")
    assert seal["signer"] == LAB
    assert seal["fingerprint"] == fingerprint
    public = shutil.copy(settings / "seal_key.pub", tmp_path / "lab.pub")
    settings.rename(tmp_path / "elsewhere")
    code, said, seal = status(labrig, sealed)
    assert (code, said, seal["is_trusted"], seal["calls_itself"]) == (0, "sealed", False, LAB)
    assert "unknown key" in labrig("verify", sealed).out
    assert status(labrig, sealed, "--signers", public)[2]["signer"] == LAB
    assert labrig("key", "trust", public).code == 0
    assert status(labrig, sealed)[2]["signer"] == LAB
    create_key(tmp_path / "other", "Somebody else")
    assert status(labrig, sealed, "--signers", tmp_path / "other.pub")[0] == 4


def test_a_run_that_has_to_be_sealed_is_refused_without_a_seal(
    labrig: Labrig, finished: Path, tmp_path: Path
) -> None:
    create_key(tmp_path / "lab", LAB)
    assert labrig("verify", finished).code == 0
    assert labrig("verify", finished, "--signers", tmp_path / "lab.pub").code == 4


@pytest.mark.skipif(shutil.which("ssh-keygen") is None, reason="needs OpenSSH")
def test_openssh_checks_a_seal_and_its_signature_is_read(
    labrig: Labrig, sealed: Path, settings: Path, tmp_path: Path
) -> None:
    text = (sealed / "seal.sha256").read_bytes()
    allowed = tmp_path / "allowed"
    allowed.write_text(f'lab namespaces="labrig-run" {(settings / "seal_key.pub").read_text()}')
    check: list[str | Path] = [
        "ssh-keygen",
        "-Y",
        "verify",
        "-f",
        allowed,
        "-I",
        "lab",
        "-n",
        "labrig-run",
        "-s",
    ]
    done = subprocess.run([*check, sealed / "seal.sha256.sig"], input=text, capture_output=True)
    assert done.returncode == 0, done.stderr
    assert read_signers(allowed).names == {read_key(settings / "seal_key").public: LAB}
    sign: list[str | Path] = [
        "ssh-keygen",
        "-Y",
        "sign",
        "-f",
        settings / "seal_key",
        "-n",
        "labrig-run",
    ]
    theirs = subprocess.run(sign, input=text, capture_output=True, check=True).stdout
    (sealed / "seal.sha256.sig").write_bytes(theirs)
    assert status(labrig, sealed)[:2] == (0, "sealed")
    other = subprocess.run([*sign[:-1], "file"], input=text, capture_output=True, check=True)
    (sealed / "seal.sha256.sig").write_bytes(other.stdout)
    assert status(labrig, sealed)[:2] == (4, "changed")


def append(path: Path) -> None:
    path.write_bytes(path.read_bytes() + b"\n")


@pytest.mark.parametrize(
    "name",
    ["frames/000003.dng", "result/series.csv", "protocol.yaml", "rig.yaml", "seal.sha256",
     "made.txt", "log.txt"],
)  # fmt: skip
def test_a_file_that_was_changed_is_named(labrig: Labrig, sealed: Path, name: str) -> None:
    append(sealed / name)
    ended = labrig("verify", sealed)
    assert (ended.code, len(ended.err.splitlines())) == (4, 1)
    assert name in ended.err


def test_files_that_came_and_went_are_named(labrig: Labrig, sealed: Path) -> None:
    (sealed / "result" / "summary.txt").rename(sealed / "result" / "planted.txt")
    ended = labrig("verify", sealed)
    assert ended.code == 4
    assert "summary.txt was removed" in ended.err
    assert "planted.txt was added" in ended.err


def test_a_forger_who_chains_all_lines_anew_is_refused(labrig: Labrig, sealed: Path) -> None:
    journal = sealed / "journal.jsonl"
    journal.write_text(journal.read_text().replace('"late_s": 0.0', '"late_s": 0.01'))
    reseal(journal)
    for command in ("verify", "process"):
        ended = labrig(command, sealed)
        assert (ended.code, len(ended.err.splitlines())) == (4, 1)
        assert "journal.jsonl" in ended.err
    (sealed / "seal.sha256.sig").unlink()
    assert "broken" in labrig("verify", sealed).out


def test_a_sealed_run_is_processed_again_and_sealed_anew(labrig: Labrig, sealed: Path) -> None:
    assert labrig("process", sealed).code == 0
    assert status(labrig, sealed)[:2] == (0, "sealed")
    assert labrig("process", sealed, "--states", 1).code == 0
    ended = labrig("verify", sealed)
    assert ended.code == 4
    assert "result/result.json was changed" in ended.err
    assert labrig("seal", sealed).code == 0
    assert status(labrig, sealed)[:2] == (0, "sealed")


def test_a_run_that_went_on_is_told_from_an_edited_one(labrig: Labrig, finished: Path) -> None:
    journal, whole = finished / "journal.jsonl", read_run(finished).seal
    lines = journal.read_bytes().splitlines(keepends=True)
    journal.write_bytes(b"".join(lines[: len(lines) // 2]))
    shutil.rmtree(finished / "result")
    assert labrig("key", "new", LAB).code == 0
    assert labrig("seal", finished).code == 0
    assert labrig("resume", finished, "--yes").code == 0
    assert read_run(finished).seal != whole
    ended = labrig("verify", finished)
    assert ended.code == 4
    assert "went on after it was sealed" in ended.err


def test_a_damaged_run_is_not_sealed(labrig: Labrig, finished: Path) -> None:
    append(finished / "frames" / "000003.dng")
    assert labrig("key", "new", LAB).code == 0
    ended = labrig("seal", finished)
    assert ended.code == 4
    assert "000003.dng" in ended.err
    assert not (finished / "seal.sha256").exists()


@pytest.fixture(scope="module")
def signed(tmp_path_factory: pytest.TempPathFactory) -> tuple[bytes, str]:
    key = create_key(tmp_path_factory.mktemp("key") / "key", LAB)
    return b"numbers", signature_text(b"numbers", key.private)


@given(st.data())
def test_a_damaged_signature_is_refused_in_a_line(
    signed: tuple[bytes, str], data: st.DataObject
) -> None:
    message, text = signed
    start = data.draw(st.integers(0, len(text)))
    end = data.draw(st.integers(start, len(text)))
    damaged = text[:start] + data.draw(st.text(max_size=8)) + text[end:]
    if "".join(damaged.split()) == "".join(text.split()):
        return
    with pytest.raises(DataError) as refused:
        signer_of(message, damaged)
    assert len(str(refused.value).splitlines()) == 1


def test_an_armour_has_nothing_beside_its_ends(signed: tuple[bytes, str]) -> None:
    message, text = signed
    for damaged in (text.replace("-----END", "0\t-----END"), text.replace("E-----\n", "E-----0\n")):
        with pytest.raises(DataError):
            signer_of(message, damaged)


@given(st.text(max_size=60) | st.binary(max_size=60))
def test_a_file_that_has_no_keys_is_refused(
    tmp_path_factory: pytest.TempPathFactory, content: str | bytes
) -> None:
    file = tmp_path_factory.mktemp("keys") / "keys"
    file.write_bytes(content if isinstance(content, bytes) else content.encode("utf-8", "replace"))
    with pytest.raises(UsageError) as refused:
        read_signers(file)
    assert len(str(refused.value).splitlines()) == 1
