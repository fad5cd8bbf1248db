"""Descriptions of keys, and the examples in them, from the docstrings of models of files."""

import inspect
import re
from collections.abc import Iterator

from pydantic import BaseModel

_EXAMPLE = re.compile(r"for example\s+`\[?([^`,\]]+)")


def descriptions(model: type[BaseModel]) -> dict[str, str]:
    """Return the description of every documented field of a model, and of its base classes.

    Parameters
    ----------
    model
        Model with a numpy docstring, or with descriptions of its own in its fields.

    Returns
    -------
    dict of str to str
        Descriptions by the names of the fields.

    Examples
    --------
    >>> from labrig.acquire import Sample
    >>> from labrig.foundation.key_texts import descriptions
    >>> descriptions(Sample)["batch"]
    'Batch or lot of the sample as free text, for example `B-17`. It is recorded, not used.'
    """
    texts: dict[str, str] = {}
    for part in reversed(model.__mro__):
        texts.update(_attributes(inspect.cleandoc(part.__doc__ or "")))
    return texts


def _attributes(documented: str) -> Iterator[tuple[str, str]]:
    """Yield name and text of each entry in a numpy docstring's section of attributes."""
    _, _, section = documented.partition("Attributes\n----------\n")
    for names, text in re.findall(r"^(\w[\w, ]*)\n((?:    .*\n?|\n(?=    ))+)", section, re.M):
        for name in names.split(","):
            yield name.strip(), " ".join(text.split())


def example(model: type[BaseModel], key: str) -> str:
    """Return the example in the description of a key as it stands in a file; empty without one.

    Parameters
    ----------
    model
        Model that has the key.
    key
        Key in a file.

    Examples
    --------
    >>> from labrig.acquire import Sample
    >>> from labrig.foundation.key_texts import example
    >>> example(Sample, "thickness")
    '0.4 mm'
    """
    for name, field in model.model_fields.items():
        if key in (name, field.alias):
            text = field.description or descriptions(model).get(name, "")
            match = _EXAMPLE.search(text)
            return match[1].strip() if match else ""
    return ""
