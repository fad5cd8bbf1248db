"""The rig that commands use where none is given: of the environment, or chosen by `rig use`."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from labrig.cli.completion import complete_rig
from labrig.foundation.errors import LabrigError, UsageError
from labrig.foundation.input_file import read_text
from labrig.foundation.user_folder import settings_file

#: Environment variable with a rig, which has priority over the one that was chosen.
VARIABLE = "LABRIG_RIG"

RigOption = Annotated[
    str | None,
    typer.Option(
        "--rig",
        help="A shipped rig, such as 'sim', or a path to a YAML file; by default that of 'labrig "
        "rig use'.",
        autocompletion=complete_rig,
    ),
]
RigArgument = Annotated[
    str | None,
    typer.Argument(
        help="A shipped rig, such as 'sim', or a path to a YAML file; by default that of 'labrig "
        "rig use'.",
        autocompletion=complete_rig,
    ),
]


@dataclass(frozen=True)
class DefaultRig:
    """A rig that needs not be given.

    Attributes
    ----------
    name
        Name of a shipped rig, or path of a file.
    is_of_environment
        Whether the environment variable names it, rather than `labrig rig use`.
    """

    name: str
    is_of_environment: bool

    @property
    def source(self) -> str:
        """Description of where it was chosen."""
        if self.is_of_environment:
            return f"the environment variable {VARIABLE}"
        return "'labrig rig use'"

    def path(self) -> Path:
        """Return the path of the rig's file.

        Raises
        ------
        UsageError
            It is gone, or was misspelt in the environment variable.
        """
        from labrig.foundation import resources

        try:
            return resources.find("config", "rig", self.name)
        except UsageError as error:
            remedy = (
                f"set it to another rig or unset it ({VARIABLE})"
                if self.is_of_environment
                else "choose another one (labrig rig use FILE)"
            )
            raise UsageError(
                f"{error}; it is the default rig, by {self.source}: {remedy}, or give --rig"
            ) from None


def default_rig() -> DefaultRig | None:
    """Return the default rig, None if there is none."""
    if name := os.environ.get(VARIABLE):
        return DefaultRig(name, is_of_environment=True)
    return _chosen_rig()


def _chosen_rig() -> DefaultRig | None:
    """Return the rig of `labrig rig use`, None if there is none."""
    choice = _choice_file()
    if not choice.exists():
        return None
    try:
        name = read_text(choice).strip()
    except LabrigError as error:
        raise UsageError(f"{error}; choose the default rig again: labrig rig use FILE") from None
    return DefaultRig(name, is_of_environment=False) if name else None


def rig_path(rig: str | None) -> Path:
    """Return the file of a rig as given, or else of the default rig, which is then printed.

    Raises
    ------
    UsageError
        There is no such rig, or none was given and there is no default.
    """
    from labrig.foundation import resources

    if rig is not None:
        return resources.find("config", "rig", rig)
    default = default_rig()
    if default is None:
        raise UsageError(
            "expected a rig, got none: give one, such as --rig sim or --rig ./my-rig.yaml, or make "
            "yours the default: labrig rig use ./my-rig.yaml"
        )
    path = default.path()
    typer.echo(f"rig: {default.name}, by {default.source}", err=True)
    return path


def use(
    rig: Annotated[
        str | None,
        typer.Argument(
            help="A shipped rig, such as 'sim', or a path.",
            autocompletion=complete_rig,
            show_default=False,
        ),
    ] = None,
    forget: Annotated[bool, typer.Option("--forget", help="Have no default rig.")] = False,
) -> None:
    """Make a rig the default of all commands; without RIG, print which it is and who says so.

    The environment variable LABRIG_RIG has priority over this choice.
    """
    if forget and rig is not None:
        raise UsageError(f"--forget: expected no rig beside it, got '{rig}'")
    if forget:
        _choice_file().unlink(missing_ok=True)
    elif rig is not None:
        _choose(rig)
    default = default_rig()
    if (forget or rig is not None) and default is not None and default.is_of_environment:
        chosen = _chosen_rig()
        choice = "is forgotten" if chosen is None else f"is now {chosen.name}"
        typer.echo(
            f"the choice of 'labrig rig use' {choice}; {default.source} has priority as long as it "
            "is set:"
        )
    if default is None:
        typer.echo("there is no default rig; choose one: labrig rig use ./my-rig.yaml")
        return
    default.path()
    typer.echo(f"{default.name}, by {default.source}")


def _choose(rig: str) -> None:
    from labrig.acquire import read_rig_file
    from labrig.consent import calls, give_consent, starting
    from labrig.foundation import resources
    from labrig.foundation.output_file import make_folder, write_text

    path = resources.find("config", "rig", rig)
    file = read_rig_file(path)  # a mistake in the file is better found now
    deeds = list(calls(file.addresses()))
    if isinstance(file.on_finish, tuple):
        deeds.append(starting(file.on_finish))
    if deeds:
        give_consent(deeds)
        typer.echo(f"note: with your consent, every run on it {', '.join(deeds)}", err=True)
    is_shipped = resources.names("config").get(rig) == path
    choice = _choice_file()
    make_folder(choice.parent)
    write_text(choice, f"{rig if is_shipped else path.absolute()}\n")


def _choice_file() -> Path:
    """Return the file with the chosen rig in the folder of this user's settings."""
    return settings_file("rig.txt")
