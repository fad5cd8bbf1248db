from .bands import (
    Bands as Bands,
)
from .dark_room import (
    CARD_NAME as CARD_NAME,
    DarkRoomLamp as DarkRoomLamp,
    DarkRoomPicture as DarkRoomPicture,
    dark_room as dark_room,
)
from .display import (
    Display as Display,
    camera_values as camera_values,
    tristimulus as tristimulus,
)
from .exported_scene import (
    ExportedCamera as ExportedCamera,
    ExportedMesh as ExportedMesh,
    Glow as Glow,
)
from .exr import (
    SpectralFrame as SpectralFrame,
    read_linear_exr as read_linear_exr,
    read_spectral_exr as read_spectral_exr,
    write_linear_exr as write_linear_exr,
    write_spectral_exr as write_spectral_exr,
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
    Samples as Samples,
    Surface as Surface,
)
from .gltf import (
    write_gltf as write_gltf,
)
from .lamp import (
    Lamp as Lamp,
    LampTable as LampTable,
)
from .mesh import (
    Mesh as Mesh,
    read_mesh as read_mesh,
)
from .mitsuba_scene import (
    write_mitsuba_scene as write_mitsuba_scene,
)
from .night import (
    NightLook as NightLook,
    night_view as night_view,
    scotopic_luminance as scotopic_luminance,
)
from .png import (
    read_png_texts as read_png_texts,
    write_png as write_png,
)
from .render_folder import (
    RenderFolder as RenderFolder,
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
from .scene_export import (
    exported_camera as exported_camera,
    exported_meshes as exported_meshes,
)
from .scene_file import (
    MaterialEntry as MaterialEntry,
    SceneFile as SceneFile,
    read_scene as read_scene,
)
from .shown import (
    check_exposure as check_exposure,
    shown_frames as shown_frames,
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
from .video import (
    require_ffmpeg as require_ffmpeg,
    write_video as write_video,
)
from .wavelength_shift import (
    LampWavelengths as LampWavelengths,
    ShiftedWavelengths as ShiftedWavelengths,
    WavelengthShift as WavelengthShift,
    balance as balance,
    direct_light as direct_light,
    rotated_wavelengths as rotated_wavelengths,
)
