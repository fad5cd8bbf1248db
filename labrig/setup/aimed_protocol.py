"""The protocol whose regions are drawn: what it says now, and what is written into it."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from labrig.acquire import read_protocol
from labrig.errors import UsageError
from labrig.region import Region
from labrig.setup.patches_block import KEY, rounded, write_patches


class AimedProtocol:
    """A person's protocol file.

    Parameters
    ----------
    path
        Of the file.

    Raises
    ------
    UsageError
        Not a protocol, or one of a kind that has no regions.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        if not path.is_file():
            raise UsageError(
                f"{path}: no such protocol file; regions are written into a file of your own, so "
                "copy a shipped one first (see labrig protocol list)"
            )
        self._regions = self._read()

    def in_fractions(self) -> list[dict[str, Any]]:
        """Regions that can be shown: name and fractions of the frame."""
        return [
            {"name": name, "region": list(region)}
            for name, region in self._regions.items()
            if max(region) <= 1
        ]

    def in_pixels(self) -> list[str]:
        """Names of those that cannot: pixels of a RAW frame, whose size nobody knows here."""
        return [name for name, region in self._regions.items() if max(region) > 1]

    def write(self, patches: Mapping[str, Region]) -> list[dict[str, Any]]:
        """Replace the regions in the file; returns them as they now stand in it.

        Raises
        ------
        UsageError
            The protocol would not be one any more; the file is as before.
        DiskError
            It cannot be written.
        """
        write_patches(self.path, {name: rounded(region) for name, region in patches.items()})
        self._regions = self._read()
        return self.in_fractions()

    def _read(self) -> dict[str, Region]:
        model = read_protocol(self.path)
        regions = getattr(model, KEY, None)
        if regions is None:
            raise UsageError(
                f"{self.path}: a protocol of the kind '{model.protocol}' has no '{KEY}:' to draw"
            )
        return dict(regions)
