"""`labrig schema`: JSON Schemas with which editors complete and check YAML files."""

from typing import Annotated

import typer


def schema(
    kind: Annotated[str, typer.Argument(help="protocol, rig, material, scene or design")],
) -> None:
    """Print the JSON Schema of a kind of file, for editors."""
    import json

    from labrig.schema import schema as schema_of

    typer.echo(json.dumps(schema_of(kind), indent=2))
