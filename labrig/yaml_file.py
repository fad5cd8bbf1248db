"""YAML files a person writes, read into models, with errors a person understands.

PyYAML's safe loader with YAML 1.2 scalars (`1:30` and `0100` are not numbers in disguise, `1e-3`
is one, `no` is a word) that refuses duplicate keys.
"""

import difflib
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar, get_args

import yaml
from pydantic import BaseModel, ValidationError

from labrig.errors import UsageError

ModelT = TypeVar("ModelT", bound=BaseModel)

_INT = re.compile(r"[-+]?(?:0|[1-9][0-9]*)")
_FLOAT = re.compile(
    r"[-+]?(?:(?:0|[1-9][0-9]*)\.[0-9]*|\.[0-9]+|(?:0|[1-9][0-9]*))(?:[eE][-+]?[0-9]+)?"
    r"|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)"
)


class _Loader(yaml.SafeLoader):
    """SafeLoader with the scalars of YAML 1.2's core schema."""

    yaml_implicit_resolvers: dict[str, list[tuple[str, re.Pattern[str]]]] = {}  # noqa: RUF012

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen: dict[str, int] = {}
        for key_node, _ in node.value:
            key, line = str(key_node.value), key_node.start_mark.line + 1
            if key in seen:
                raise yaml.constructor.ConstructorError(
                    problem=f"the key '{key}' stands twice (also in line {seen[key]}); keep one",
                    problem_mark=key_node.start_mark,
                )
            seen[key] = line
        return super().construct_mapping(node, deep)


def _construct_float(loader: _Loader, node: yaml.ScalarNode) -> float:
    text = str(node.value).lower().lstrip("+")
    if text.lstrip("-") == ".inf":
        return -math.inf if text.startswith("-") else math.inf
    return math.nan if text == ".nan" else float(text)


for _tag, _pattern, _first in (
    ("bool", re.compile("true|True|TRUE|false|False|FALSE"), "tTfF"),
    ("null", re.compile("~|null|Null|NULL|"), ["~", "n", "N", ""]),
    ("int", _INT, "-+0123456789"),
    ("float", _FLOAT, "-+.0123456789"),
):
    _whole = re.compile(f"(?:{_pattern.pattern})\\Z")
    _Loader.add_implicit_resolver(f"tag:yaml.org,2002:{_tag}", _whole, list(_first))
_Loader.add_constructor("tag:yaml.org,2002:float", _construct_float)
_Loader.add_constructor("tag:yaml.org,2002:int", lambda loader, node: int(str(node.value)))


def read_yaml(path: Path) -> dict[str, Any]:
    """The mapping in the file at `path`.

    Raises
    ------
    UsageError
        Not readable, not YAML, a duplicate key, or not a mapping.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise UsageError(f"{path}: no such file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"{path}: cannot be read as UTF-8 text ({error})") from None
    return parse_yaml(text, str(path))


def parse_yaml(text: str, source: str) -> dict[str, Any]:
    """As `read_yaml`, from text; `source` names it in messages."""
    try:
        content = yaml.load(text, Loader=_Loader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        place = "" if mark is None else f", line {mark.line + 1}"
        problem = " ".join(str(error.problem or error.context).split())
        raise UsageError(f"{source}{place}: {problem}") from None
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise UsageError(f"{source}: not YAML ({' '.join(str(error).split())})") from None
    if not isinstance(content, dict):
        raise UsageError(f"{source}: expected 'key: value' lines, got {_kind(content)}")
    return content


def write_yaml(path: Path, model: BaseModel) -> None:
    """Write `model` so that `read_model` gives it back; nothing half-written stays."""
    path.write_text(yaml_text(model.model_dump(mode="json", exclude_none=False)), encoding="utf-8")


def yaml_text(content: Mapping[str, Any]) -> str:
    """YAML text of plain values, keys in the given order."""
    return yaml.safe_dump(dict(content), sort_keys=False, allow_unicode=True, width=100)


def read_model(path: Path, model: type[ModelT]) -> ModelT:
    """The file at `path` as `model`; errors are one line and name the file and the key."""
    return validate(read_yaml(path), model, str(path))


def validate(content: Mapping[str, Any], model: type[ModelT], source: str) -> ModelT:
    """`content` as `model`.

    Raises
    ------
    UsageError
        The first thing that is wrong, with a suggestion where a key is misspelt.
    """
    try:
        return model.model_validate(content)
    except ValidationError as error:
        raise UsageError(f"{source}: {_first_problem(error, model)}") from None


def did_you_mean(word: str, known: Sequence[str]) -> str:
    """A hint at what `word` may have been meant to be, or the list of what is known."""
    close = difflib.get_close_matches(word, known, n=1, cutoff=0.6)
    return f"did you mean '{close[0]}'?" if close else f"known: {', '.join(sorted(known))}"


def _first_problem(error: ValidationError, model: type[BaseModel]) -> str:
    problems = error.errors(include_url=False)
    # A misspelt key usually makes a required one missing, too: name the misspelt one.
    problem = next((p for p in problems if p["type"] == "extra_forbidden"), problems[0])
    place = ".".join(str(part) for part in problem["loc"])
    if problem["type"] == "extra_forbidden":
        keys = list(_sibling_keys(model, problem["loc"]))
        return f"unknown key '{place}'; {did_you_mean(str(problem['loc'][-1]), keys)}"
    if problem["type"] == "missing":
        return f"the key '{place}' is missing; it is required"
    said = problem["msg"].removeprefix("Value error, ")
    came = "" if "got " in said else f", got {_kind(problem['input'])}"
    return f"{place}: {said}{came}" if place else f"{said}{came}"


def _sibling_keys(model: type[BaseModel], location: tuple[int | str, ...]) -> Iterator[str]:
    """Keys that a mapping at `location` may have, over all models it may be."""
    models: list[type[BaseModel]] = [model]
    for part in location[:-1]:
        inner = [
            nested
            for candidate in models
            for name, field in candidate.model_fields.items()
            if part in (name, field.alias)
            for nested in _models_in(field.annotation)
        ]
        models = inner or models
    for candidate in models:
        yield from (field.alias or name for name, field in candidate.model_fields.items())


def _models_in(annotation: Any) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for argument in get_args(annotation):
        yield from _models_in(argument)


def _kind(value: Any) -> str:
    if value is None:
        return "nothing"
    if isinstance(value, (dict, list)):
        return "a mapping" if isinstance(value, dict) else "a list"
    return f"'{value}'"
