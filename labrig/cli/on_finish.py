"""Notification at the end of a run, as the rig file asks for: a bell or a command."""

import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from labrig.cli.screen import note
from labrig.consent import has_consent, starting
from labrig.foundation.clock import Interrupted
from labrig.foundation.errors import LabrigError
from labrig.foundation.readable_output import spelled

#: Longest duration of the command.
COMMAND_TIMEOUT_S = 30.0


@dataclass
class Ending:
    """Message about the end of a run."""

    message: str = ""


def permitted(
    on_finish: str | Sequence[str] | None, path: Path, *, is_asked_for: bool
) -> str | Sequence[str] | None:
    """Return what may happen at the end: a bell always, a command by consent alone.

    Parameters
    ----------
    on_finish
        Entry of the rig file.
    path
        Rig file, named in the note about a command that will not be started.
    is_asked_for
        Whether `--on-finish` was given.
    """
    if on_finish is None or isinstance(on_finish, str):
        return on_finish
    if is_asked_for or has_consent(starting(on_finish)):
        return on_finish
    note(
        f"note: 'on_finish' in {path} will not be obeyed, in case somebody else wrote it: it "
        f"{starting(on_finish)}; add --on-finish for this run, or consent for all: "
        "labrig rig use FILE"
    )
    return None


@contextmanager
def notify_at_end(on_finish: str | Sequence[str] | None) -> Iterator[Ending]:
    """Notify when the body has ended, however it ended; devices are safe by then.

    Parameters
    ----------
    on_finish
        `bell`, or a command with its arguments; None for no notification. The command finds in its
        environment `LABRIG_STATUS` (`done`, `interrupted`, `failed`) and `LABRIG_MESSAGE`, one
        line.
    """
    ending = Ending()
    try:
        yield ending
    except Interrupted as stop:
        _notify(on_finish, "interrupted", str(stop))
        raise
    except LabrigError as error:
        _notify(on_finish, "failed", str(error))
        raise
    _notify(on_finish, "done", ending.message)


def _notify(on_finish: str | Sequence[str] | None, status: str, message: str) -> None:
    if on_finish == "bell":
        print("\a", end="", file=sys.stderr, flush=True)
    elif on_finish:
        text = spelled(message, sys.getfilesystemencoding(), "surrogateescape")
        _run_command(on_finish, {"LABRIG_STATUS": status, "LABRIG_MESSAGE": text})


def _run_command(command: Sequence[str], variables: dict[str, str]) -> None:
    """Run a command; a failure of it is only a warning, since the run is over and kept."""
    try:
        subprocess.run(
            list(command),
            env=os.environ | variables,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            timeout=COMMAND_TIMEOUT_S,
            check=True,
        )
    except (OSError, subprocess.SubprocessError) as error:
        print(f"labrig: warning: on_finish: {' '.join(str(error).split())}", file=sys.stderr)
