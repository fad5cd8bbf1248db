"""labrig: from a lab bench to a measured phosphorescent or fluorescent material.

All that a notebook needs is here::

    import labrig

    result = labrig.process_run("runs/2026-01-01T00-00-00_decay_blue-paint")
    series = labrig.read_series("result/series.csv")[0]
    fit = labrig.fit_series(series)
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from labrig.acquire import ExposureSettings as ExposureSettings
    from labrig.acquire import Plan as Plan
    from labrig.acquire import plan as plan
    from labrig.acquire import read_protocol as read_protocol
    from labrig.acquire import read_rig_file as read_rig_file
    from labrig.analyse import Choices as Choices
    from labrig.analyse import fit_series as fit_series
    from labrig.bench import open_bench as open_bench
    from labrig.errors import DataError as DataError
    from labrig.errors import DeviceError as DeviceError
    from labrig.errors import FitError as FitError
    from labrig.errors import FrameError as FrameError
    from labrig.errors import LabrigError as LabrigError
    from labrig.errors import UsageError as UsageError
    from labrig.export import read_dataset as read_dataset
    from labrig.export import to_tiled as to_tiled
    from labrig.fit import DecayFit as DecayFit
    from labrig.fit import fit_decay as fit_decay
    from labrig.material import Material as Material
    from labrig.material import read_material as read_material
    from labrig.material import write_material as write_material
    from labrig.optics import CameraResponse as CameraResponse
    from labrig.optics import read_camera as read_camera
    from labrig.process import process_run as process_run
    from labrig.record import RunRecord as RunRecord
    from labrig.record import read_run as read_run
    from labrig.reduce import measure as measure
    from labrig.reduce import read_raw as read_raw
    from labrig.results import Series as Series
    from labrig.results import read_series as read_series

#: Public name → module. Loaded when first used, so that `labrig --help` answers at once.
_HOME = {
    "Choices": "process",
    "CameraResponse": "optics",
    "DataError": "errors",
    "DecayFit": "fit",
    "DeviceError": "errors",
    "ExposureSettings": "acquire",
    "FitError": "errors",
    "FrameError": "errors",
    "LabrigError": "errors",
    "Material": "material",
    "Plan": "acquire",
    "RunRecord": "record",
    "Series": "results",
    "UsageError": "errors",
    "open_bench": "bench",
    "fit_decay": "fit",
    "fit_series": "process",
    "measure": "reduce",
    "plan": "acquire",
    "process_run": "process",
    "read_camera": "optics",
    "read_dataset": "export",
    "read_material": "material",
    "read_protocol": "acquire",
    "read_raw": "reduce",
    "read_rig_file": "acquire",
    "read_run": "record",
    "read_series": "results",
    "to_tiled": "export",
    "write_material": "material",
}

__all__ = list(_HOME)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'labrig' has no attribute '{name}'")
    return getattr(importlib.import_module(f"labrig.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOME])
