"""End of a command: an exit code, and one line for an error."""

import errno
import re
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from labrig.cli.detachable_stream import DetachableStream
from labrig.cli.screen import note
from labrig.cli.under_way import showing_work
from labrig.foundation.activity import checking
from labrig.foundation.clock import Interrupted
from labrig.foundation.errors import (
    DiskError,
    LabrigError,
    MemoryShortageError,
    UsageError,
    is_memory_shortage,
    memory_shortage,
)
from labrig.foundation.readable_output import spelled
from labrig.foundation.signals import await_signals, ignore_signals, raise_again

if TYPE_CHECKING:
    from typer.exceptions import TyperException


#: Largest number of characters of a file name in a message.
MAX_SHOWN = 200
#: What a device or a file names may be no text, or move the terminal's cursor.
_SHOWN = {number: repr(chr(number))[1:-1] for number in (*range(32), *range(127, 160))}
#: Surrogates, to which Python decodes bytes of an argument that are not UTF-8.
_NO_TEXT = re.compile("[\ud800-\udfff]")
_SET_LOCALE = "set a locale with UTF-8, such as LC_ALL=C.UTF-8"


def guarded(arguments: Sequence[str]) -> int:
    """Run the command line and return its exit code.

    Errors become one line on standard error. Signals that would stop the process are ignored
    afterwards: the process is expected to end.

    Parameters
    ----------
    arguments
        Arguments of the command line, without the name of the program.

    Returns
    -------
    int
        0 on success; `LabrigError.exit_code` of the error; 2 for a wrong call; 128 plus the number
        of the signal that stopped the command; 1 for a fault of labrig itself.

    Examples
    --------
    >>> from labrig.cli import guarded
    >>> guarded(["--version"])
    labrig ...
    0
    """
    try:
        code = _run(arguments)
    except BrokenPipeError:
        code = 0  # the reader has ended with all it needs: head, less
    finally:
        DetachableStream(sys.stdout).flush()
        ignore_signals()
    return code


def _run(arguments: Sequence[str]) -> int:
    import typer
    from typer.exceptions import TyperException

    from labrig.cli.app import command

    if any(_NO_TEXT.search(argument) for argument in arguments):
        encoding = sys.getfilesystemencoding()
        remedy = "; rename the others" if encoding == "utf-8" else f"; {_SET_LOCALE}"
        return _print_error(
            f"expected arguments in {encoding.upper()}, got {' '.join(map(ascii, arguments))}"
            f"{remedy}",
            2,
        )
    await_signals()
    try:
        try:
            with showing_work(arguments), checking(raise_again):
                words = list(arguments) or ["--help"]
                command()(args=words, prog_name="labrig", standalone_mode=False)
        except Exception:
            raise_again()  # in place of what a signal's exception became
            raise
    except Interrupted as interrupted:
        return _print_error(str(interrupted), 128 + interrupted.signum)
    except LabrigError as error:
        return _print_error(str(error), error.exit_code)
    except typer.Exit as ending:
        return ending.exit_code
    except SystemExit as ending:  # Typer's own answer to a pipe without a reader
        raise BrokenPipeError from ending
    except TyperException as error:
        return _print_error(_wrong_call(error), 2)
    except OSError as error:
        if isinstance(error, BrokenPipeError):
            raise
        if is_memory_shortage(error):
            return _print_shortage(error)
        name = str(error.filename or "disk")[:MAX_SHOWN]
        kind = UsageError if error.errno == errno.ENAMETOOLONG else DiskError
        return _print_error(f"{name}: {error.strerror or error}", kind.exit_code)
    except UnicodeEncodeError as error:
        if _cannot_be_named(error):
            return _print_error(_unwritable(error), UsageError.exit_code)
        return _print_error(_fault_message(error), 1)
    except Exception as error:
        if is_memory_shortage(error):
            return _print_shortage(error)
        return _print_error(_fault_message(error), 1)
    return 0


def _wrong_call(error: "TyperException") -> str:
    """Return what is wrong with the arguments, and where the command's own help is."""
    from pydantic import ValidationError

    from labrig.foundation.model_errors import is_rule, refusal

    message = error.format_message()
    if isinstance(error.__cause__, ValidationError):
        problems = error.__cause__.errors(include_url=False)
        received = "" if is_rule(problems[0]) else f", got '{problems[0]['input']}'"
        reason = f"{refusal(problems[0], problems)}{received}"
        message = message.replace(problems[0]["msg"], reason)
    context = getattr(error, "ctx", None)
    command = "labrig" if context is None else context.command_path
    # Some commands show all their options only for what is named.
    command = getattr(getattr(context, "command", None), "helped_by", command)
    options = () if context is None else [each.opts for each in context.command.params]
    if "'%Y-%m-%d'" in message:
        message = re.sub("does not match the formats.*", "is no day such as 2026-11-21", message)
    if "unexpected extra argument" in message and ["--rig"] in options:
        message += ": a rig is given by --rig"
    return f"{message} (see {command} --help)"


def _cannot_be_named(error: UnicodeEncodeError) -> bool:
    """Whether a name came from a file system that has other characters, or has to go to one."""
    is_of_locale = error.encoding == sys.getfilesystemencoding() != "utf-8"
    return is_of_locale or _NO_TEXT.search(error.object) is not None


def _unwritable(error: UnicodeEncodeError) -> str:
    """Return that a path is no text, or that the locale has no such file names."""
    # Of a long text with the name in it, the part before it that cannot be written.
    name = spelled(error.object[max(error.end - MAX_SHOWN, 0) : error.end], "ascii").strip()
    if error.encoding == "utf-8":
        return f"{name}: expected names of files and folders in UTF-8; rename the others"
    return f"{name}: the locale has file names in {error.encoding} only; {_SET_LOCALE}"


def _fault_message(error: Exception) -> str:
    """Write the traceback of a fault of labrig to a file and return a message that names it."""
    import tempfile
    import traceback

    with tempfile.NamedTemporaryFile(
        "w", prefix="labrig-fault-", suffix=".txt", delete=False, encoding="utf-8"
    ) as file:
        traceback.print_exception(error, file=file)
    return f"a fault in labrig itself ({error!r}); please report it with {file.name}"


def _print_shortage(error: Exception) -> int:
    return _print_error(str(memory_shortage(error)), MemoryShortageError.exit_code)


def _print_error(text: str, code: int) -> int:
    note(f"labrig: {' '.join(text.split()).translate(_SHOWN)}")
    return code
