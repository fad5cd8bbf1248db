from .dataset import dataset_of as dataset_of
from .frame import frame_of as frame_of
from .image_stack import write_image_stack as write_image_stack
from .nexus import write_nexus as write_nexus
from .tiled import to_tiled as to_tiled
