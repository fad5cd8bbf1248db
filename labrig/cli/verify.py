"""`labrig verify`: is a run as it was recorded?"""

from pathlib import Path
from typing import Annotated

import typer

from labrig.cli.completion import complete_run
from labrig.errors import DataError


def verify(
    run: Annotated[
        Path,
        typer.Argument(
            help="A run folder, the beginning of its name, or 'last'.", autocompletion=complete_run
        ),
    ],
    runs: Annotated[Path, typer.Option("--runs", help="Folder of the run folders.")] = Path("runs"),
) -> None:
    """Check that journal, frames and result of a run are as they were recorded.

    Every frame is read. The seal that is printed is that of the whole journal: kept elsewhere, it
    shows later that nothing was changed.
    """
    from labrig.catalogue import find_run
    from labrig.process import verify_run

    verification = verify_run(find_run(run, runs))
    for line in verification.intact:
        typer.echo(line)
    if not verification.is_intact:
        raise DataError("; ".join(verification.changed))
