from .bands import (
    Bands as Bands,
)
from .field import (
    Field as Field,
)
from .field_parameters import (
    FieldParameters as FieldParameters,
)
from .folding import (
    Matrices as Matrices,
    fold as fold,
)
from .geometry import (
    Geometry as Geometry,
    Surface as Surface,
)
from .lamp import (
    Lamp as Lamp,
    LampTable as LampTable,
)
from .mesh import (
    Mesh as Mesh,
    read_mesh as read_mesh,
)
from .rendering import (
    Frame as Frame,
    Renderer as Renderer,
)
from .scene import (
    Assumptions as Assumptions,
    Scene as Scene,
    build_scene as build_scene,
    load_scene as load_scene,
)
from .scene_file import (
    SceneFile as SceneFile,
    read_scene as read_scene,
)
from .surface_material import (
    BenchLight as BenchLight,
    SurfaceMaterial as SurfaceMaterial,
    of_albedo as of_albedo,
    of_matrix as of_matrix,
    of_phosphor as of_phosphor,
)
from .tracing import (
    PathLength as PathLength,
    Paths as Paths,
    Pinhole as Pinhole,
    Tracer as Tracer,
)
