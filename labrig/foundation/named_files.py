"""Keys of YAML files that name a file, which lies beside the YAML file unless its path is absolute.

The type of a key in its model tells whether it names a file: a sample that is called `batch-3.1`
keeps its name, whatever lies beside the file.
"""

import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel


@dataclass(frozen=True)
class NamesFile:
    """Mark of a type of text that names a file or folder.

    Attributes
    ----------
    or_shipped
        Whether a bare word is the name of something shipped instead.
    """

    or_shipped: bool


#: Path of a file or folder.
FilePath = Annotated[str, NamesFile(or_shipped=False)]
#: Name of something shipped, such as `halogen_3000k`, or path of a file or folder.
ShippedOrFile = Annotated[str, NamesFile(or_shipped=True)]


def is_path(named: str) -> bool:
    """Return whether a name is a path; a bare word is a shipped name, whatever files exist.

    Examples
    --------
    >>> from labrig.foundation.named_files import is_path
    >>> is_path("lamp.csv"), is_path("./lamp"), is_path("halogen_3000k"), is_path("FL3.15")
    (True, True, False, False)
    """
    is_suffix = re.fullmatch(r"\.[A-Za-z]\w*", Path(named).suffix) is not None
    return is_suffix or "/" in named or os.sep in named


def beside(named: str, folder: Path) -> str:
    """Return a file's path from the folder of the file that names it; a shipped name as it is."""
    return _in_folder(named, folder) if is_path(named) else named


def with_absolute_paths(
    content: Mapping[str, Any], model: type[BaseModel], folder: Path
) -> dict[str, Any]:
    """Return the content of a YAML file with absolute paths where its model has a path.

    Parameters
    ----------
    content
        Content as YAML loads it, valid or not.
    model
        Model of the content. Keys of the types `FilePath`, `ShippedOrFile` and `pathlib.Path` name
        files, as do those in lists, mappings and models within it.
    folder
        Folder of the YAML file.

    Returns
    -------
    dict
        The content with the paths of named files from `folder`, absolute if `folder` is.

    Examples
    --------
    >>> from pathlib import Path
    >>> from pydantic import BaseModel
    >>> from labrig.foundation.named_files import ShippedOrFile, with_absolute_paths
    >>> class Sample(BaseModel):
    ...     name: str
    ...     material: ShippedOrFile
    >>> content = {"name": "paint.a", "material": "paint.yaml"}
    >>> with_absolute_paths(content, Sample, Path("/lab"))
    {'name': 'paint.a', 'material': '/lab/paint.yaml'}
    """
    keys = _keys(model)
    return {key: _absolute(value, keys.get(key, []), folder) for key, value in content.items()}


def _absolute(value: Any, types: list[Any], folder: Path) -> Any:
    """Return a value with absolute paths; it has one of the types, or should have."""
    if isinstance(value, str):
        marks = [each for each in types if isinstance(each, NamesFile)]
        if Path in types or any(not mark.or_shipped for mark in marks):
            return _in_folder(value, folder)
        return beside(value, folder) if marks else value
    if isinstance(value, list):
        of_items = [
            each
            for kind in types
            if get_origin(kind) in (list, tuple)
            for item in get_args(kind)
            for each in _alternatives(item)
        ]
        return [_absolute(item, of_items, folder) for item in value]
    if isinstance(value, dict):
        models = [each for each in types if isinstance(each, type) and issubclass(each, BaseModel)]
        fitting = [model for model in models if value.keys() <= _keys(model).keys()] or models
        of_values = [
            each
            for kind in types
            if get_origin(kind) in (dict, Mapping)
            for each in _alternatives(get_args(kind)[1])
        ]
        return {
            key: _absolute(
                inner,
                [each for model in fitting for each in _keys(model).get(key, [])] + of_values,
                folder,
            )
            for key, inner in value.items()
        }
    return value


@cache
def _keys(model: type[BaseModel]) -> dict[str, list[Any]]:
    """Return the types that the value of each key of a model may have, and marks of paths."""
    return {
        field.alias or name: [*_alternatives(field.annotation), *field.metadata]
        for name, field in model.model_fields.items()
    }


def _alternatives(annotation: Any) -> Iterator[Any]:
    """Yield the types of a union, and what they are annotated with."""
    if get_origin(annotation) is Annotated:
        inner, *marks = get_args(annotation)
        yield from _alternatives(inner)
        yield from marks
    elif get_origin(annotation) in (Union, UnionType):
        for each in get_args(annotation):
            yield from _alternatives(each)
    else:
        yield annotation


def _in_folder(named: str, folder: Path) -> str:
    if not named:
        return named
    try:
        return str(folder / Path(named).expanduser())
    except RuntimeError:  # '~' of nobody
        return str(folder / named)
