"""Every kind of calibration is known to rig files, to analyses, and under its protocol's name."""

from pathlib import Path
from typing import Any

import pytest
from pydantic import BaseModel

from labrig.acquire import read_rig_file
from labrig.calibration import CalibrationKind, kinds
from labrig.foundation import plugins
from labrig.foundation.errors import UsageError

RIG = """name: x
devices: {{camera: {{driver: ptp_camera, address: "usb://04a9:3199"}}}}
optics: {{{key}: {named}}}
"""
every_kind = pytest.mark.parametrize("kind", kinds(), ids=lambda kind: kind.name)


@every_kind
def test_a_rig_file_names_its_file_and_analyses_have_it(
    kind: CalibrationKind[Any], tmp_path: Path
) -> None:
    path = tmp_path / "rig.yaml"
    path.write_text(RIG.format(key=kind.optics_key, named="mine"))
    optics = read_rig_file(path).optics
    mine = str(path.parent / "mine")
    assert [optics.named(one) for one in kinds() if optics.named(one)] == [mine]
    assert optics.named(kind) == mine
    assert kind.protocol in plugins.names(plugins.MEASUREMENTS)


class Text(BaseModel):
    """A file of a kind of its own."""

    text: str


@pytest.mark.parametrize("parts", [[], ["one"], ["one", "two"]], ids=len)
def test_the_file_itself_or_the_one_in_a_runs_result(parts: list[str], tmp_path: Path) -> None:
    kind = CalibrationKind("text", "blank", "text", "text.yaml", Text)
    for part in parts:
        folder = tmp_path / "result" / part
        folder.mkdir(parents=True)
        kind.write(folder, Text(text=part))
    if parts == ["one"]:
        assert kind.read(tmp_path).text == "one"
        assert kind.read(tmp_path / "result" / "one" / "text.yaml").text == "one"
    else:
        with pytest.raises(UsageError, match=f"one text.yaml in its result, got {len(parts)}"):
            kind.read(tmp_path)
