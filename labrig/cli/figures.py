"""`labrig figures`: the figures of a report for print."""

from pathlib import Path
from typing import Annotated

import typer

from labrig.cli.completion import complete_run


def figures(
    run: Annotated[
        Path,
        typer.Argument(
            help="A run folder, the beginning of its name, or 'last'.", autocompletion=complete_run
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option("--out", help="PDF to write, instead of result/figures/figures.pdf of RUN."),
    ] = None,
    runs: Annotated[Path, typer.Option("--runs", help="Folder of the run folders.")] = Path("runs"),
) -> None:
    """Draw all figures of a run's report into one PDF, for print.

    They are drawn from result.json, so that nothing is measured or fitted again.
    """
    from labrig.catalogue import find_run
    from labrig.process import draw_figures

    path, n_pages = draw_figures(find_run(run, runs), out)
    typer.echo(f"{path}: {n_pages} figures")
