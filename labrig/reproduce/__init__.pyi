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
from .gltf import (
    write_gltf as write_gltf,
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
from .video import (
    require_ffmpeg as require_ffmpeg,
    write_video as write_video,
)
