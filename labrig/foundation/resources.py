"""Files shipped with labrig: protocols, rigs, materials, optical data."""

import os
from pathlib import Path

from labrig.foundation.errors import UsageError
from labrig.foundation.file_kind import CURVES, MATERIAL, PROTOCOL, RIG, SCENE, require_kind
from labrig.foundation.input_file import whereabouts
from labrig.foundation.named_files import is_path
from labrig.foundation.plugins import measurements
from labrig.foundation.yaml_file import did_you_mean

_PACKAGE = Path(__file__).parents[1]
#: Place of the protocol files.
PROTOCOLS = "protocols"
#: Suffixes of shipped files: YAML, or measured curves in JSON.
SUFFIXES = (".yaml", ".yml", ".json")
#: Kinds of files by their descriptions in messages.
_KINDS = {
    "protocol": (PROTOCOL,),
    "rig": (RIG,),
    "material": (MATERIAL,),
    "scene": (SCENE,),
    "camera": (CURVES,),
}


def folder(name: str) -> Path:
    """Return the path of a shipped folder such as `config` or `protocols`."""
    return (_PACKAGE / name).resolve()


def find(place: str, kind: str, name_or_path: str | os.PathLike[str]) -> Path:
    """Return the file of a shipped name (`decay`, `sim`, `blue-paint`), or the path as given.

    A bare word is always a shipped name, whatever lies in the current folder; a user's file is
    given with its suffix or a folder before it.

    Parameters
    ----------
    place
        Shipped folder of such names, such as `config/materials`.
    kind
        Description in messages, such as `material`.
    name_or_path
        Name of a shipped file, or path of a file.

    Raises
    ------
    UsageError
        There is neither a shipped file of that name nor a file at that path.
    """
    path = Path(name_or_path)
    if path.suffix in SUFFIXES or len(path.parts) > 1:
        require_kind(path, *_KINDS[kind])
        if path.is_dir():
            raise UsageError(f"{path}: expected a {kind} file, got a folder")
        if not path.is_file():
            raise UsageError(f"{path}: no such {kind} file{whereabouts(path)}")
        return path
    shipped = names(place)
    if str(path) not in shipped:
        if path.is_dir():
            raise UsageError(f"{path}: expected a {kind} file, got a folder; name a file in it")
        if path.suffix:
            require_kind(path, *_KINDS[kind])
        suffix = next(iter(shipped.values())).suffix
        raise UsageError(
            f"no shipped {kind} is called '{path}' (a file of your own is given with its suffix, "
            f"such as {path}{suffix}); {did_you_mean(str(path), list(shipped))}"
        )
    return shipped[str(path)]


def curve_path(named: str) -> Path:
    """Return the path of a measured curve as given, or the shipped one of that name.

    Parameters
    ----------
    named
        Name of a shipped table, such as `grey_card_18`, or path of a file.
    """
    if is_path(named):
        return Path(named)
    return folder("config/optics") / f"{named}.csv"


def names(place: str) -> dict[str, Path]:
    """Return the files that are shipped in a folder by name, sorted.

    Those of protocols lie in the folders of the measurements, of packages too.
    """
    folders = [folder(place)]
    if place == PROTOCOLS:
        folders = [registered.folder for _, registered in measurements()]
    files = (path for each in folders for path in each.iterdir() if path.suffix in SUFFIXES)
    return {path.stem: path for path in sorted(files, key=lambda path: path.stem)}
