"""A mistake of a beginner, and the files that it is made with."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import exp

DECAY = "protocol: decay\nsample: {name: paint}\ncharge: 5 min\nfor: 60 s\n"
TIMES_S = range(0, 60, 2)
INTENSITIES = [100 * exp(-time_s / 20) + 0.3 * (-1) ** (time_s // 2) for time_s in TIMES_S]
TWO_COLUMNS = "time,intensity\n" + "".join(
    f"{t},{i:.3f}\n" for t, i in zip(TIMES_S, INTENSITIES, strict=True)
)


@dataclass(frozen=True)
class Mistake:
    """Something that a beginner does: a command, with the files that lie in the folder.

    Attributes
    ----------
    needs
        A regular expression: what the answer has to contain to be of help.
    exit_code
        Expected; 0 where labrig is to understand what was meant.
    has_run
        Whether the folder has a processed run, `runs/mine`, and one of its frames, `frame.dng`.
    """

    name: str
    command: str
    needs: str
    exit_code: int = 2
    files: Mapping[str, str] = field(default_factory=dict)
    has_run: bool = False


def protocol_mistake(name: str, text: str, needs: str, exit_code: int = 2) -> Mistake:
    """Return the mistake of planning this protocol on the simulated rig."""
    files = {"mine.yaml": text}
    return Mistake(name, "plan mine.yaml --rig sim", needs, exit_code, files)


SIM_RIG = """\
name: mine
devices:
  lamp: {driver: numato, address: sim://room/relays, relay: 0}
  camera: {driver: ptp_camera, address: sim://room/camera, shutter_lag: 60 ms}
optics: {camera: canon_eos_5d_mark_ii}
simulation: {sample: blue-paint, sensor: {width: 96, height: 64}}
"""
