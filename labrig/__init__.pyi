from .acquire import (
    ExposureSettings as ExposureSettings,
    Plan as Plan,
    plan as plan,
    read_protocol as read_protocol,
    read_rig_file as read_rig_file,
)
from .analyse import (
    Overrides as Overrides,
    fit_series as fit_series,
)
from .bench import open_bench as open_bench
from .export import to_tiled as to_tiled
from .fit import (
    DecayFit as DecayFit,
    fit_decay as fit_decay,
)
from .foundation.errors import (
    DataError as DataError,
    DeviceError as DeviceError,
    FitError as FitError,
    FrameError as FrameError,
    LabrigError as LabrigError,
    UsageError as UsageError,
)
from .material import (
    Material as Material,
    read_material as read_material,
    write_material as write_material,
)
from .optics import (
    CameraResponse as CameraResponse,
    read_camera as read_camera,
)
from .process import process_run as process_run
from .protocols.blank.result import BlankResult as BlankResult
from .protocols.decay.result import DecayResult as DecayResult
from .protocols.phosphor.result import PhosphorResult as PhosphorResult
from .record import (
    RunRecord as RunRecord,
    read_run as read_run,
)
from .reduce import (
    measure as measure,
    read_raw as read_raw,
)
from .results import (
    FittedDecay as FittedDecay,
    Measured as Measured,
    RunResult as RunResult,
    Series as Series,
    read_result as read_result,
    read_series as read_series,
)
