"""Build hook: `drivers`, `protocols`, `sim` and `config` become parts of the package `labrig`.

They stand beside `labrig/` in the repository, where people look for them. A wheel holds them inside
`labrig/`. An editable installation gets links: `labrig/<folder>` to the folder, and
`.editable/labrig` to the package, so that the repository itself is not put on the import path.
"""

import os
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

FOLDERS = ("drivers", "protocols", "sim", "config")
#: Pages of the manual that `labrig explain` reads.
PAGES = ("docs/glossary.md", "docs/reference/warnings.md")
EDITABLE = ".editable"


class OneName(BuildHookInterface[Any]):
    """Put the folders under `labrig`, as copies in a wheel and as links in a checkout."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Prepare a wheel (`version` is "standard") or an editable installation ("editable")."""
        root = Path(self.root)
        if version == "editable":
            for folder in (*FOLDERS, "docs"):
                _link(root / "labrig" / folder, root / folder)
            (root / EDITABLE).mkdir(exist_ok=True)
            _link(root / EDITABLE / "labrig", root / "labrig")
        else:
            build_data["force_include"] |= {
                str(root / part): f"labrig/{part}" for part in (*FOLDERS, *PAGES)
            }


def _link(link: Path, target: Path) -> None:
    if link.is_symlink():
        link.unlink()
    if os.name == "nt":
        # A junction needs no privilege, unlike a symbolic link. Not yet tried on Windows.
        import _winapi

        if not link.exists():
            _winapi.CreateJunction(str(target), str(link))  # type: ignore[attr-defined,unused-ignore]
        return
    link.symlink_to(os.path.relpath(target, link.parent), target_is_directory=True)
