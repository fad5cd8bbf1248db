from .dataset import (
    read_dataset as read_dataset,
    tree_of as tree_of,
)
from .image_stack import write_image_stack as write_image_stack
from .nexus import write_nexus as write_nexus
from .tiled import to_tiled as to_tiled
