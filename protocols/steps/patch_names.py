"""Names of patches, each of which is a folder of the result; their layout below a filter."""

import re
import unicodedata
from itertools import combinations
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, Field

from labrig.foundation.region import Region

#: Characters of paths, devices or patterns, or refused ones, on some system.
_FORBIDDEN = './\\:*?"<>|'
_LONGEST = 60
#: Names of other folders of a result, and Windows' names of devices.
_TAKEN = re.compile(r"figures|con|prn|aux|nul|(?:com|lpt)\d")


def _with_text_names(patches: Any) -> dict[str, Any]:
    """Return patches by names that are texts: YAML reads `1: […]` as a number."""
    if not isinstance(patches, dict) or not patches:
        raise ValueError("expected 'name: [x, y, width, height]' for each patch")
    return {"" if name is None else str(name): region for name, region in patches.items()}


def _can_be_folder(name: str) -> bool:
    return (
        0 < len(name) <= _LONGEST
        and name == name.strip()
        and name.isprintable()
        and not set(name) & set(_FORBIDDEN)
        and not _TAKEN.fullmatch(name)
    )


def _folders(patches: dict[str, Region]) -> dict[str, Region]:
    """Refuse a name that is no folder on every disk, or two names of the same folder."""
    names: dict[str, str] = {}
    for name in patches:
        folder = unicodedata.normalize("NFC", name).casefold()
        if not _can_be_folder(folder):
            raise ValueError(
                f"expected names of patches that can be folders (1 to {_LONGEST} characters, none "
                f"of {' '.join(_FORBIDDEN)}, no space around, not 'figures'), got '{name}'"
            )
        if folder in names:
            raise ValueError(
                "expected names of patches that differ in more than capital letters, got "
                f"'{names[folder]}' and '{name}'"
            )
        names[folder] = name
    return patches


def sample_folders(names: tuple[str, ...]) -> tuple[str, ...]:
    """Refuse names of samples that are no folders, or are given twice.

    Raises
    ------
    ValueError
        A name is no folder on every disk, or two names are of the same folder.
    """
    if len(set(names)) < len(names):
        raise ValueError(f"expected every sample once, got {', '.join(names)}")
    _folders(dict.fromkeys(names, (0.0, 0.0, 1.0, 1.0)))
    return names


def _with_text_names_or_none(patches: Any) -> dict[str, Any]:
    return {} if patches in (None, {}) else _with_text_names(patches)


def _in_separate_rows(patches: dict[str, Region]) -> dict[str, Region]:
    """Refuse patches that share rows; pixels and fractions are not compared."""
    for (name, (_, y, _, high)), (other, (_, other_y, _, other_high)) in combinations(
        patches.items(), 2
    ):
        same_unit = (max(patches[name]) <= 1) == (max(patches[other]) <= 1)
        if same_unit and y < other_y + other_high and other_y < y + high:
            raise ValueError(
                "expected patches one above the other, each in rows of its own and as long as the "
                f"filter, got '{name}' in rows {y:g} to {y + high:g} and '{other}' in rows "
                f"{other_y:g} to {other_y + other_high:g}"
            )
    return patches


#: Regions of interest by name.
Patches = Annotated[dict[str, Region], BeforeValidator(_with_text_names), AfterValidator(_folders)]

#: Rows of different materials below one strip of the variable filter; none: all of it is one.
FilterPatches = Annotated[
    dict[str, Region],
    BeforeValidator(_with_text_names_or_none),
    AfterValidator(_folders),
    AfterValidator(_in_separate_rows),
]

#: Names of samples that are measured one after another.
SampleNames = Annotated[tuple[str, ...], Field(min_length=1), AfterValidator(sample_folders)]
