"""`labrig protocol`: what protocols there are."""

import typer

app = typer.Typer(help="The protocols that can be run.")


@app.command("list")
def list_protocols() -> None:
    """Shipped protocol files and what each of them does."""
    from labrig import shipped
    from labrig.acquire import plugins

    for path in sorted(shipped.folder("protocols").glob("*.yaml")):
        model = plugins.read_protocol(path)
        said = path.read_text(encoding="utf-8").splitlines()[0].removeprefix("#").strip()
        typer.echo(f"{path.stem:16} ({model.protocol})  {said}")


@app.callback()
def protocols() -> None:
    """The protocols that can be run."""
