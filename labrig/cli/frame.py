"""`labrig frame`: statistics of one RAW file."""

from pathlib import Path
from typing import Annotated

import typer


def frame(
    file: Annotated[Path, typer.Argument(help="A RAW file: Bayer, X-Trans, no colours.")],
    roi: Annotated[
        str | None,
        typer.Option("--roi", help="x,y,width,height in pixels of the visible frame."),
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Print as JSON.")] = False,
) -> None:
    """Mean, uncertainty, scatter, clipped and hot pixels per colour channel of a RAW file."""
    import json as json_format

    from labrig.foundation.region import parse_region
    from labrig.reduce import measure, read_raw

    region = None if roi is None else parse_region(roi)
    measured = measure(read_raw(file), region)
    if json:
        typer.echo(json_format.dumps(measured.to_json()))
    else:
        typer.echo(str(measured))
