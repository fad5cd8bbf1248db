"""Exports of runs and results to NeXus, xarray and Tiled."""

from labrig.export.dataset import read_dataset, tree_of
from labrig.export.nexus import write_nexus
from labrig.export.tiled import to_tiled

__all__ = ["read_dataset", "to_tiled", "tree_of", "write_nexus"]
