from .export.gltf import (
    write_gltf as write_gltf,
)
from .export.mitsuba_scene import (
    write_mitsuba_scene as write_mitsuba_scene,
)
from .export.rgb_preview import (
    RgbPreview as RgbPreview,
    rgb_preview as rgb_preview,
)
from .export.scene_export import (
    ExportedMesh as ExportedMesh,
    Glow as Glow,
    exported_meshes as exported_meshes,
)
from .mesh_file.read_mesh import (
    read_mesh as read_mesh,
)
from .picture.display import (
    Display as Display,
    camera_values as camera_values,
    tristimulus as tristimulus,
)
from .picture.exr import (
    SpectralFrame as SpectralFrame,
    read_linear_exr as read_linear_exr,
    read_spectral_exr as read_spectral_exr,
    write_linear_exr as write_linear_exr,
    write_spectral_exr as write_spectral_exr,
)
from .picture.png import (
    read_png_texts as read_png_texts,
    write_png as write_png,
)
from .picture.render_folder import (
    RenderFolder as RenderFolder,
)
from .picture.rendering import (
    Frame as Frame,
    Renderer as Renderer,
    Seen as Seen,
)
from .picture.shown import (
    NightLook as NightLook,
    night_view as night_view,
    scotopic_luminance as scotopic_luminance,
    shown_frames as shown_frames,
    white_under as white_under,
)
from .picture.video import (
    require_ffmpeg as require_ffmpeg,
    write_video as write_video,
)
from .picture.view import (
    require_traceable as require_traceable,
)
from .scene.built_scene import (
    Assumptions as Assumptions,
    Scene as Scene,
    build_scene as build_scene,
    load_scene as load_scene,
)
from .scene.dark_room import (
    CARD_NAME as CARD_NAME,
    DarkRoomLamp as DarkRoomLamp,
    DarkRoomPicture as DarkRoomPicture,
    dark_room as dark_room,
    under_lamps as under_lamps,
)
from .scene.scene_file import (
    BandsEntry as BandsEntry,
    MaterialEntry as MaterialEntry,
    ProgrammeEntry as ProgrammeEntry,
    SceneFile as SceneFile,
    read_scene as read_scene,
)
from .surface.bands import (
    Bands as Bands,
)
from .surface.field import (
    Field as Field,
    FieldParameters as FieldParameters,
)
from .surface.parameter_texture import (
    ParameterTexture as ParameterTexture,
    read_parameter_texture as read_parameter_texture,
    write_parameter_texture as write_parameter_texture,
)
from .surface.surface_material import (
    BenchLight as BenchLight,
    SurfaceMaterial as SurfaceMaterial,
    of_albedo as of_albedo,
    of_matrix as of_matrix,
    of_mixture as of_mixture,
    of_phosphor as of_phosphor,
)
from .transport.folding import (
    Matrices as Matrices,
    fold as fold,
)
from .transport.geometry import (
    Geometry as Geometry,
    Samples as Samples,
    Surface as Surface,
)
from .transport.lamp import (
    Lamp as Lamp,
    LampTable as LampTable,
)
from .transport.mesh import (
    Mesh as Mesh,
)
from .transport.tracing import (
    PathLength as PathLength,
    Paths as Paths,
    Pinhole as Pinhole,
    Tracer as Tracer,
)
from .transport.wavelength_shift import (
    LampWavelengths as LampWavelengths,
    ShiftedWavelengths as ShiftedWavelengths,
    WavelengthShift as WavelengthShift,
    balance as balance,
    direct_light as direct_light,
    rotated_wavelengths as rotated_wavelengths,
)
