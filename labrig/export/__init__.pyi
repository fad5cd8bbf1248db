from .dataset import (
    read_dataset as read_dataset,
    tree_of as tree_of,
)
from .nexus import write_nexus as write_nexus
from .tiled import to_tiled as to_tiled
