"""`labrig verify`, `seal` and `key`: a run is as it was recorded, and who vouches for it."""

import json as json_text
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from labrig.cli.completion import complete_run
from labrig.cli.screen import echo
from labrig.foundation.errors import DataError, UsageError
from labrig.foundation.user_folder import settings_file

if TYPE_CHECKING:
    from labrig.process import Verification
    from labrig.seal import LabKey, Signers

#: Most changes that are named in one line.
_MAX_NAMED = 6

Runs = Annotated[Path, typer.Option("--runs", help="Folder of the run folders.")]


def verify(
    run: Annotated[
        Path,
        typer.Argument(
            help="A run folder, the beginning of its name, or 'last'.", autocompletion=complete_run
        ),
    ],
    runs: Runs = Path("runs"),
    signers: Annotated[
        Path | None,
        typer.Option(
            "--signers",
            help="Public keys (.pub) or OpenSSH's allowed signers: the run has to be sealed by one "
            "of them.",
        ),
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Print the outcome as JSON.")] = False,
) -> None:
    """Check that journal, frames and result of a run are as they were recorded and sealed.

    Every frame is read. The seal of the journal that is printed is that of its last line: kept
    elsewhere, it shows later that nothing was changed. Laboratories are named by 'labrig key
    trust', by this PC's own key, and by --signers.
    """
    from labrig.catalogue import find_run
    from labrig.process import verify_run
    from labrig.seal import read_signers

    folder = find_run(run, runs)
    accepted = trusted_signers() if signers is None else read_signers(signers)
    verification = verify_run(folder, accepted)
    if json:
        typer.echo(json_text.dumps(_content(folder, verification), ensure_ascii=False, indent=2))
    else:
        for line in (*verification.intact, verification.seal_line):
            echo(line)
    for line in verification.doubtful:
        echo(f"warning: {line}", err=True)
    if not verification.is_intact:
        named, more = verification.changed[:_MAX_NAMED], verification.changed[_MAX_NAMED:]
        others = f"; {len(more)} more, all of them with --json" if more else ""
        raise DataError(f"{'; '.join(named)}{others}")
    if signers is not None and verification.signer is None:
        raise DataError(f"{folder}: expected a seal by a key in {signers}, got none such")


def seal(
    run: Annotated[
        list[Path],
        typer.Argument(
            help="Run folders, beginnings of their names, or 'last'.", autocompletion=complete_run
        ),
    ],
    runs: Runs = Path("runs"),
    key: Annotated[
        Path | None,
        typer.Option("--key", help="Another private key than that of 'labrig key new'."),
    ] = None,
) -> None:
    """Sign runs by the laboratory's own key, so that they can be cited and checked elsewhere.

    Journal, frames and result are checked before. The list of files with their SHA-256 is
    seal.sha256 in the run folder, its signature seal.sha256.sig: 'labrig verify', or sha256sum and
    ssh-keygen, check both.
    """
    from labrig.catalogue import find_run
    from labrig.foundation.clock import SystemClock
    from labrig.process import seal_run
    from labrig.seal import read_key

    path = key_file() if key is None else key
    if not path.exists():
        raise UsageError(f"{path}: there is no such key; make one: labrig key new NAME")
    lab_key = read_key(path)
    for folder in [find_run(each, runs) for each in run]:
        made = seal_run(folder, lab_key, SystemClock().wall())
        echo(
            f"{folder}: sealed {made.files.sealed}, {len(made.files.sha256)} files, by "
            f"{lab_key.name} ({made.signer.fingerprint})"
        )


def _content(folder: Path, verification: "Verification") -> dict[str, object]:
    """Return the outcome of a check as JSON has it."""
    seal = verification.seal
    return {
        "run": folder.resolve().name,
        "status": verification.status,
        "journal": verification.journal,
        "intact": verification.intact,
        "changed": verification.changed,
        "doubtful": verification.doubtful,
        "seal": None
        if seal is None
        else {
            "sealed": seal.files.sealed,
            "files": len(seal.files.sha256),
            "fingerprint": seal.signer.fingerprint,
            "is_trusted": verification.signer is not None,
            "signer": verification.signer,
            "calls_itself": seal.files.by,
            "journal": seal.files.journal,
        },
    }


key_app = typer.Typer(help="The key by which this laboratory seals runs, and keys of others.")


@key_app.command("new")
def new(
    name: Annotated[str, typer.Argument(help="Name of the laboratory, as others are to read it.")],
) -> None:
    """Make the key of this laboratory and print its public half.

    The private half is in this user's own settings, with mode 600 and without a passphrase: keep a
    copy of it where nobody else reads. Publish the other half, on the laboratory's page or in a
    paper, so that others can check your seals.
    """
    from labrig.seal import create_key

    path = key_file()
    _print(create_key(path, name), path)


@key_app.command("show")
def show() -> None:
    """Print the public key of this laboratory with its fingerprint."""
    from labrig.seal import read_key

    path = key_file()
    if not path.exists():
        raise UsageError(f"{path}: there is no key yet; make one: labrig key new 'NAME OF THE LAB'")
    _print(read_key(path), path)


@key_app.command("trust")
def trust(
    file: Annotated[Path, typer.Argument(help="Public keys, or OpenSSH's allowed signers.")],
) -> None:
    """Accept the laboratories in a file of public keys by their names from now on.

    Compare the fingerprints with those that a laboratory itself has published.
    """
    from labrig.foundation.output_file import make_folder, write_text
    from labrig.seal import Signers, read_signers

    new_signers, trusted = read_signers(file), _trusted_file()
    before = read_signers(trusted) if trusted.exists() else Signers()
    make_folder(trusted.parent)
    write_text(trusted, (before | new_signers).text())
    for key, name in new_signers.names.items():
        echo(f"{name} ({key.fingerprint})")


def key_file() -> Path:
    """Return the file of this laboratory's private key in the folder of this user's settings."""
    return settings_file("seal_key")


def trusted_signers() -> "Signers":
    """Return the laboratories whose keys were trusted, and this one."""
    from labrig.seal import Signers, public_file, read_signers

    signers = Signers()
    for file in (_trusted_file(), public_file(key_file())):
        if file.exists():
            signers = signers | read_signers(file)
    return signers


def _trusted_file() -> Path:
    return settings_file("trusted_keys")


def _print(key: "LabKey", path: Path) -> None:
    typer.echo(key.public_line)
    echo(f"{key.name} ({key.public.fingerprint}); private key: {path}", err=True)
