"""The command `labrig process`, which has the options of measurements besides its own."""

from collections.abc import Iterable
from inspect import Parameter, Signature
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_origin

import typer
from typer.core import TyperCommand

if TYPE_CHECKING:
    from labrig.analyse import ProcessOptions

#: Keys of the context's `meta`: given options of measurements, words of the line, options in help.
GIVEN, _WORDS, _SHOWN = "labrig.options", "labrig.words", "labrig.shown"


class ProcessCommand(TyperCommand):
    """Command that takes every measurement's options, and shows those of the run that is named."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the words of the line, which help needs to find the run."""
        ctx.meta[_WORDS] = tuple(args)
        return super().parse_args(ctx, args)

    def get_params(self, ctx: Any) -> list[Any]:
        """Return its own parameters and the options of measurements."""
        from labrig.foundation.plugins import measurements

        models = ctx.meta.get(_SHOWN)
        if models is None:
            loaded = (registered.load("options") for _, registered in measurements())
            models = [model for model in loaded if model is not None]
        return [*super().get_params(ctx), *_options(models)]

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Show its own options and, if a run is named, those of its measurements."""
        ctx.meta[_SHOWN] = _options_of_run(ctx.meta[_WORDS])
        super().format_options(ctx, formatter)


def _options_of_run(words: tuple[str, ...]) -> "list[type[ProcessOptions]]":
    """Return the options of the first run that is named; none where none is."""
    from labrig.analyse import options_of, read_run_protocol
    from labrig.catalogue import find_run
    from labrig.foundation.errors import LabrigError

    runs = Path("runs")
    for option, value in pairwise(words):
        if option == "--runs":
            runs = Path(value)
    for word in words:
        if word.startswith("-"):
            continue
        try:
            return options_of(read_run_protocol(find_run(Path(word), runs)))
        except LabrigError:
            continue
    return []


def _options(models: "Iterable[type[ProcessOptions]]") -> list[Any]:
    """Return one option for each field, by its name; fields of one name are one option."""
    from labrig.analyse import flag

    fields = {name: field for model in models for name, field in model.model_fields.items()}
    if not fields:
        return []

    def take(**given: Any) -> None:
        """Take no options by itself: those of the signature below."""

    parameters = []
    for name, field in fields.items():
        kind: Any = str | None
        if get_origin(field.annotation) is tuple:
            kind = list[str] | None
        elif field.annotation is bool:
            kind = bool
        annotation = Annotated[kind, typer.Option(flag(name), help=field.description)]
        default = False if kind is bool else None
        parameters.append(
            Parameter(name, Parameter.KEYWORD_ONLY, default=default, annotation=annotation)
        )
    take.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
    take.__annotations__ = {each.name: each.annotation for each in parameters}
    app = typer.Typer(add_completion=False)
    app.command()(take)
    options = list(typer.main.get_command(app).params)
    for option in options:
        option.expose_value, option.callback = False, _keep
    return options


def _keep(context: Any, option: Any, value: Any) -> Any:
    """Keep a value that was given, for the measurement to which it belongs."""
    if value not in (None, False, ()) and value != []:
        context.meta.setdefault(GIVEN, {})[option.name] = value
    return value
