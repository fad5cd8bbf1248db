"""A paint that glows for an hour from earlier: the dark frames wait for it."""

from pathlib import Path
from typing import Any

from labrig.material import read_material, write_material
from labrig.record import FrameRole, read_run
from tests.analyse.recorded import record


def test_a_glow_that_clips_at_first_is_waited_for(tmp_path: Path) -> None:
    """Thirty times as bright as Table 1's, a tenth as fast: it clips for the first ten minutes."""
    paint = read_material("blue-paint")
    (state,) = paint.states
    assert state.reradiation is not None
    brighter = tuple(30 * value for value in state.reradiation)
    slow = state.model_copy(update={"k_r_per_s": 0.003, "reradiation": brighter})
    write_material(tmp_path / "slow.yaml", paint.model_copy(update={"states": (slow,)}))

    def glowing(rig: dict[str, Any]) -> None:
        paint_file = str(tmp_path / "slow.yaml")
        rig["simulation"]["sample"] = [{"material": paint_file, "region": [0.03, 0.1, 0.94, 0.8]}]
        rig["simulation"]["initial"] = {"lamp": "off", "concentration": 0.9}

    protocol = {"protocol": "decay", "charge": "5 min", "every": "5 s", "for": "30 s"}
    run = read_run(record(tmp_path, protocol | {"sample": {"name": "slow"}}, glowing))
    looks = run.frames(FrameRole.REST)
    assert 3000 < looks[-1].start_time - looks[0].start_time < 4500
