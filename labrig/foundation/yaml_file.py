"""YAML files written by users, read into models with understandable errors.

PyYAML's safe loader with YAML 1.2 scalars (`1:30` and `0100` are not numbers, `1e-3` is one, `no`
is a word) that rejects what no such file needs: duplicate keys, tags, numbers that are not finite,
invalid characters, and aliases that expand to excessive size.
"""

import difflib
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, get_args

import yaml
from pydantic import BaseModel, ValidationError
from yaml.composer import Composer

from labrig.foundation.errors import UsageError
from labrig.foundation.input_file import read_text
from labrig.foundation.key_texts import example
from labrig.foundation.model_errors import is_rule, lacks_item, place, refusal
from labrig.foundation.output_file import write_text
from labrig.foundation.quantity import in_unit_of, unit_of
from labrig.foundation.yaml_mistake import explain

ModelT = TypeVar("ModelT", bound=BaseModel)

#: Size limit; the longest files are the calibrations that labrig writes, 0.1 MB.
MAX_BYTES = 5_000_000
#: Limits of the depth, of the values, and of what aliases expand to.
MAX_DEPTH = 30
MAX_VALUES = 200_000
MAX_ALIASED = 100_000
#: Letters of a text that count as one value more, where an alias repeats them.
LETTERS_OF_VALUE = 50
TOO_DEEP = f"nested more than {MAX_DEPTH} deep"
#: Largest length of a text quoted in a message, and numbers of words that are suggested or listed.
MAX_SHOWN, MAX_SUGGESTED, MAX_LISTED = 80, 4, 60
_HOW_TO_BEGIN = "'labrig protocol new' and 'labrig rig new' write files to begin with"

#: Characters that no name or path contains: NUL, and halves of surrogate pairs.
_NO_TEXT = re.compile("[\0\ud800-\udfff]")
_INT = re.compile(r"[-+]?(?:0|[1-9][0-9]*)")
_FLOAT = re.compile(
    r"[-+]?(?:(?:0|[1-9][0-9]*)\.[0-9]*|\.[0-9]+|(?:0|[1-9][0-9]*))(?:[eE][-+]?[0-9]+)?"
    r"|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)"
)


if TYPE_CHECKING:
    from yaml import SafeDumper, SafeLoader
else:
    # libyaml is several times faster; a PyYAML built without it lacks its loader and dumper.
    SafeLoader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    SafeDumper = getattr(yaml, "CSafeDumper", yaml.SafeDumper)


class _Loader(SafeLoader, Composer):
    """SafeLoader with the scalars of YAML 1.2's core schema."""

    yaml_implicit_resolvers: dict[str, list[tuple[str, re.Pattern[str]]]] = {}  # noqa: RUF012

    def __init__(self, text: str) -> None:
        super().__init__(text)
        Composer.__init__(self)
        self._depth = self._values = 0

    def get_single_node(self) -> yaml.Node | None:
        # Not libyaml's own composer, which would pass `compose_node` by.
        node = Composer.get_single_node(self)
        if node is not None:
            extents: dict[yaml.Node, tuple[int, int]] = {}
            nodes, depth = _extent(node, extents)
            if nodes - sum(map(_own_extent, extents)) > MAX_ALIASED or depth > MAX_DEPTH + 1:
                raise _problem("its aliases stand for more than fits such a file", node)
        return node

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        event: Any = self.peek_event()  # type: ignore[no-untyped-call]
        if (tag := getattr(event, "tag", None)) is not None:
            tag_text = tag.replace("tag:yaml.org,2002:", "!!")
            raise _problem(
                f"the tag '{_shortened(tag_text)}' has no meaning here; leave it out", event
            )
        if isinstance(event, yaml.ScalarEvent) and _NO_TEXT.search(event.value):
            raise _problem(f"expected text, got {_shortened(ascii(event.value))}", event)
        if self._depth > MAX_DEPTH:
            raise _problem(TOO_DEEP, event)
        self._values += 1
        if self._values > MAX_VALUES:
            raise _problem(f"expected at most {MAX_VALUES} keys and values, got more", event)
        self._depth += 1
        node: yaml.Node | None = super().compose_node(parent, index)
        self._depth -= 1
        return node

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        key_lines: dict[str, int] = {}
        for key_node, _ in node.value:
            if not isinstance(key_node, yaml.ScalarNode):
                raise _problem("expected a word as key, got a list or a mapping", key_node)
            key, line = str(key_node.value), key_node.start_mark.line + 1
            if key in key_lines:
                raise _problem(
                    f"the key '{_shortened(key)}' stands twice (also in line {key_lines[key]}); "
                    "keep one",
                    key_node,
                )
            key_lines[key] = line
        return super().construct_mapping(node, deep)


def _problem(text: str, source: Any) -> yaml.MarkedYAMLError:
    """Return the error about a node or an event."""
    return yaml.MarkedYAMLError(problem=text, problem_mark=source.start_mark)


def _extent(node: yaml.Node, extents: dict[yaml.Node, tuple[int, int]]) -> tuple[int, int]:
    """Return the number of nodes in `node` and their depth, with its aliases expanded.

    `extents` has those of the nodes counted before, which an alias may refer to; (0, 0) marks a
    node that is still being counted.
    """
    if node in extents:
        if not extents[node][0]:
            raise _problem("an alias stands within what it stands for", node)
        return extents[node]
    extents[node] = 0, 0
    inner: list[yaml.Node] = []
    if isinstance(node, yaml.MappingNode):
        inner = [part for pair in node.value for part in pair]
    elif isinstance(node, yaml.SequenceNode):
        inner = node.value
    inner_extents = [_extent(part, extents) for part in inner]
    extents[node] = (
        _own_extent(node) + sum(nodes for nodes, _ in inner_extents),
        1 + max((depth for _, depth in inner_extents), default=0),
    )
    return extents[node]


def _own_extent(node: yaml.Node) -> int:
    """Return what a node counts without those within it."""
    if isinstance(node, yaml.ScalarNode):
        return 1 + len(node.value) // LETTERS_OF_VALUE
    return 1


def _construct_float(loader: _Loader, node: yaml.ScalarNode) -> float:
    text = str(node.value)
    if not text.lstrip("+-.")[:1].isdigit() or math.isinf(float(text)):
        raise _problem(f"expected a finite number, got {_shortened(text)}", node)
    return float(text)


for _tag, _pattern, _first in (
    ("bool", re.compile("true|True|TRUE|false|False|FALSE"), "tTfF"),
    ("null", re.compile("~|null|Null|NULL|"), ["~", "n", "N", ""]),
    ("int", _INT, "-+0123456789"),
    ("float", _FLOAT, "-+.0123456789"),
):
    _full_pattern = re.compile(f"(?:{_pattern.pattern})\\Z")
    _Loader.add_implicit_resolver(f"tag:yaml.org,2002:{_tag}", _full_pattern, list(_first))
_Loader.add_constructor("tag:yaml.org,2002:float", _construct_float)
_Loader.add_constructor("tag:yaml.org,2002:int", lambda loader, node: int(str(node.value)))


class _Dumper(SafeDumper):
    """Dumper that quotes every text that PyYAML's own reader or this one would not read as text."""

    yaml_implicit_resolvers = {  # noqa: RUF012
        first: [
            *yaml.SafeDumper.yaml_implicit_resolvers.get(first, []),
            *_Loader.yaml_implicit_resolvers.get(first, []),
        ]
        for first in {*yaml.SafeDumper.yaml_implicit_resolvers, *_Loader.yaml_implicit_resolvers}
    }


def read_yaml(path: Path) -> dict[str, Any]:
    """Read the mapping in the file at `path`.

    Raises
    ------
    UsageError
        The file is not readable, not YAML, has a duplicate key, or is not a mapping.
    DiskError
        The disk cannot be read.
    """
    return parse_yaml(read_text(path, MAX_BYTES), str(path))


def parse_yaml(text: str, source: str) -> dict[str, Any]:
    """Parse the mapping in a text like `read_yaml`; `source` names it in messages."""
    try:
        content = yaml.load(text, Loader=_Loader)
    except yaml.MarkedYAMLError as error:
        mistake = explain(error, text)
        place = "" if mistake.line is None else f", line {mistake.line}"
        # Looking ahead for the end of a key, libyaml may meet a limit of its own first.
        problem = TOO_DEEP if "nesting depth" in mistake.text else mistake.text
        raise UsageError(f"{source}{place}: {problem}") from None
    except yaml.reader.ReaderError:
        raise UsageError(
            f"{source}: not YAML (expected a text file, got characters that are no text)"
        ) from None
    except (yaml.YAMLError, ValueError) as error:
        raise UsageError(f"{source}: not YAML ({' '.join(str(error).split())})") from None
    if content is None:
        raise UsageError(f"{source}: expected 'key: value' lines, got nothing; {_HOW_TO_BEGIN}")
    if not isinstance(content, dict):
        raise UsageError(
            f"{source}: expected 'key: value' lines, got {' '.join(_kind(content).split())}; "
            f"{_HOW_TO_BEGIN}"
        )
    return content


def write_yaml(path: Path, model: BaseModel) -> None:
    """Write `model` so that `read_model` reads it."""
    write_text(path, model_text(model))


def model_text(model: BaseModel) -> str:
    """Return the text that `write_yaml` writes."""
    return yaml_text(model.model_dump(mode="json", exclude_none=False))


def yaml_text(content: Mapping[str, Any]) -> str:
    """Return YAML text of plain values, keys in the given order."""
    return yaml.dump(dict(content), Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=100)


def read_model(path: Path, model: type[ModelT]) -> ModelT:
    """Read the file at `path` as `model`; errors are one line and name the file and the key."""
    return validate(read_yaml(path), model, str(path))


def validate(content: Mapping[str, Any], model: type[ModelT], source: str) -> ModelT:
    """Validate `content` as `model`.

    Raises
    ------
    UsageError
        The content is invalid; the message names the first problem, with a suggestion for a
        misspelt key.
    """
    try:
        return model.model_validate(content)
    except ValidationError as error:
        raise UsageError(f"{source}: {_first_problem(error, model, content)}") from None
    except UsageError as error:  # of a part that is written as a file of its own
        if str(error).startswith(source):
            raise
        raise UsageError(f"{source}: {error}") from None


def did_you_mean(word: str, known: Sequence[str]) -> str:
    """Return the known words that are closest to `word` or begin with it, or all of them."""
    close = difflib.get_close_matches(word, known, n=MAX_SUGGESTED, cutoff=0.6)
    if not close:
        beginning = [each for each in sorted(known) if each.startswith(word)][:MAX_SUGGESTED]
        if word and beginning:
            return f"did you mean {' or '.join(map(repr, beginning))}?"
        more = f", … ({len(known)} in all)" if len(known) > MAX_LISTED else ""
        return f"known: {', '.join(sorted(known)[:MAX_LISTED])}{more}"
    matcher = difflib.SequenceMatcher(b=word)
    ratios = []
    for each in close:
        matcher.set_seq1(each)
        ratios.append(matcher.ratio())
    equal = [each for each, ratio in zip(close, ratios, strict=True) if ratio == max(ratios)]
    return f"did you mean {' or '.join(map(repr, equal))}?"


def _first_problem(
    error: ValidationError, model: type[BaseModel], content: Mapping[str, Any]
) -> str:
    problems = error.errors(include_url=False)
    # A misspelt key usually makes a required one missing, too: name the misspelt one.
    problem = next((p for p in problems if p["type"] == "extra_forbidden"), problems[0])
    where = place(problem, content)
    key = ".".join(map(str, where))
    if problem["type"] == "extra_forbidden":
        keys = list(_sibling_keys(model, problem["loc"]))
        return f"unknown key '{_shortened(key)}'; {did_you_mean(str(problem['loc'][-1]), keys)}"
    if problem["type"] == "missing" and not lacks_item(problem):
        missing = str(problem["loc"][-1])
        given = [str(each) for each in problem["input"]] if _is_block(problem["input"]) else []
        misspelt = difflib.get_close_matches(missing, given, n=1, cutoff=0.8)
        got = f"; did you mean it by '{misspelt[0]}'?" if misspelt else ""
        return f"the key '{key}' is missing; it is required{got}"
    alike = [each for each in problems if place(each, content) == where]
    shown = _example(model, where)
    message = in_unit_of(shown, refusal(problem, alike, unit_of(shown)), problem["input"])
    if problem["type"] == "model_type":
        message += f" with {', '.join(dict.fromkeys(_sibling_keys(model, (*where, ''))))}"
    # A rule of several keys names their values itself.
    names_values = is_rule(problem) and _is_block(problem["input"])
    received = "" if "got " in message or names_values else f", got {_kind(problem['input'])}"
    return f"{_shortened(key)}: {message}{received}" if key else f"{message}{received}"


def _example(model: type[BaseModel], where: Sequence[int | str]) -> str:
    """Return the example of the last key of a place in a file; empty without one."""
    keys = [number for number, part in enumerate(where) if isinstance(part, str)]
    if not keys:
        return ""
    models = _models_at(model, where[: keys[-1]])
    return next(filter(None, (example(each, str(where[keys[-1]])) for each in models)), "")


def _sibling_keys(model: type[BaseModel], location: tuple[int | str, ...]) -> Iterator[str]:
    """Yield the keys that a mapping with this key may have, over all possible models."""
    for candidate in _models_at(model, location[:-1]):
        yield from (field.alias or name for name, field in candidate.model_fields.items())


def _models_at(model: type[BaseModel], location: Sequence[int | str]) -> Sequence[type[BaseModel]]:
    """Return the models that a mapping at `location` may have."""
    models: list[type[BaseModel]] = [model]
    for part in location:
        inner = [
            nested
            for candidate in models
            for name, field in candidate.model_fields.items()
            if part in (name, field.alias)
            for nested in _models_in(field.annotation)
        ]
        models = inner or models
    return models


def _models_in(annotation: Any) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for argument in get_args(annotation):
        yield from _models_in(argument)


def _is_block(value: Any) -> bool:
    return isinstance(value, (dict, list))


def _kind(value: Any) -> str:
    if value is None:
        return "nothing"
    if _is_block(value):
        return "a mapping" if isinstance(value, dict) else "a list"
    return f"'{_shortened(str(value))}'"


def _shortened(text: str) -> str:
    text = " ".join(text.split())
    return text if len(text) <= MAX_SHOWN else text[:MAX_SHOWN] + "…"
