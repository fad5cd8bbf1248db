"""`labrig key`: the key of this laboratory, and public keys of others."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from labrig.foundation.errors import UsageError
from labrig.foundation.settings_file import settings_file

if TYPE_CHECKING:
    from labrig.seal import LabKey, Signers

app = typer.Typer(help="The key by which this laboratory seals runs, and keys of others.")


@app.command("new")
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


@app.command("show")
def show() -> None:
    """Print the public key of this laboratory with its fingerprint."""
    from labrig.seal import read_key

    path = key_file()
    if not path.exists():
        raise UsageError(f"{path}: there is no key yet; make one: labrig key new 'NAME OF THE LAB'")
    _print(read_key(path), path)


@app.command("trust")
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
        typer.echo(f"{name} ({key.fingerprint})")


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
    typer.echo(f"{key.name} ({key.public.fingerprint}); private key: {path}", err=True)
