"""`labrig sim`: simulated devices for other programs."""

from typing import Annotated

import typer

app = typer.Typer(help="Simulated devices for other programs.")


@app.command("camera")
def camera(
    port: Annotated[
        int,
        typer.Option("--port", min=0, max=65535, help="TCP port; 0 for any that is free."),
    ] = 15740,
    rig: Annotated[
        str, typer.Option("--rig", help="A shipped simulated rig, or a path to a YAML file.")
    ] = "sim",
) -> None:
    """Serve a simulated rig's camera as PTP/IP on this PC, until Ctrl-C."""
    from labrig.acquire import read_rig_file
    from labrig.bench import serve_camera
    from labrig.foundation import resources

    path = resources.find("config", "rig", rig)
    serve_camera(read_rig_file(path), str(path), port, typer.echo)


@app.callback()
def simulations() -> None:
    """Simulated devices for other programs."""
