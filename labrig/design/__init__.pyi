from .bands import (
    RGB_TO_Y as RGB_TO_Y,
    Conversion as Conversion,
    DesignBands as DesignBands,
    smooth_spectrum as smooth_spectrum,
    spectral_bands as spectral_bands,
    three_bands as three_bands,
)
from .by_hand import (
    Parameters as Parameters,
    judge as judge,
    preset_parameters as preset_parameters,
)
from .determined import (
    Conflict as Conflict,
    Estimate as Estimate,
    visible_conflicts as visible_conflicts,
)
from .keys import (
    Keys as Keys,
)
from .light import (
    LightProgramme as LightProgramme,
)
from .material_file import (
    to_material as to_material,
    written_differences as written_differences,
    written_factor as written_factor,
)
from .nearest import (
    NearestMaterial as NearestMaterial,
    material_radiance as material_radiance,
    nearest_materials as nearest_materials,
    presets as presets,
)
from .propagation import (
    Reach as Reach,
    SpreadWish as SpreadWish,
    propagate as propagate,
)
from .result import (
    Design as Design,
    Impossible as Impossible,
    key_differences as key_differences,
)
from .scene_design import (
    SceneDesign as SceneDesign,
    solve_in_scene as solve_in_scene,
)
from .scene_light import (
    PLACEHOLDER as PLACEHOLDER,
    SceneLight as SceneLight,
)
from .scene_spectra import (
    SceneSpectra as SceneSpectra,
)
from .solver import (
    solve as solve,
)
from .spread_design import (
    SpreadDesign as SpreadDesign,
    Spreading as Spreading,
    solve_spread as solve_spread,
)
from .wish_file import (
    LightChange as LightChange,
    SceneWish as SceneWish,
    Wish as Wish,
    WishedKey as WishedKey,
    WishFile as WishFile,
    read_wish as read_wish,
    to_wish as to_wish,
)
