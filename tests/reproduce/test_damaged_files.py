"""Files of a scene that came to harm: read, or refused in one line."""

import random
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from labrig.fit import fit_mixture
from labrig.foundation.errors import LabrigError
from labrig.material import read_mixture
from labrig.reproduce import (
    Mesh,
    ParameterTexture,
    read_mesh,
    read_parameter_texture,
    write_parameter_texture,
)
from tests.mutated_files import mutated
from tests.reproduce.dyes import DYE, INPUT_NM, OUTPUT_NM

TIMES = 60


def mixture(path: Path) -> None:
    matrix = DYE.to_matrix(INPUT_NM, OUTPUT_NM)
    path.write_text(fit_mixture(matrix, 1, threshold=1e-9).to_json(), encoding="utf-8")


def texture(path: Path) -> None:
    rng = np.random.default_rng(1)
    write_parameter_texture(
        path, ParameterTexture.checked(rng.random((3, 4, 1)), albedo_factor=rng.random((3, 4)))
    )


def mesh(path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    box = Mesh.box((0, 0, 0), (1, 2, 3))
    visual = trimesh.visual.TextureVisuals(uv=box.uv)
    trimesh.Trimesh(box.vertices_m, box.faces, visual=visual, process=False).export(path)


READERS: dict[str, tuple[Callable[[Path], None], Callable[[Path], object]]] = {
    "fit.json": (mixture, read_mixture),
    "paint.npz": (texture, read_parameter_texture),
    "box.obj": (mesh, read_mesh),
    "box.ply": (mesh, read_mesh),
    "box.glb": (mesh, read_mesh),
    "box.stl": (mesh, read_mesh),
}


@pytest.mark.parametrize("name", READERS)
@pytest.mark.filterwarnings("ignore")
def test_a_file_that_came_to_harm_is_read_or_refused_in_a_line(name: str, tmp_path: Path) -> None:
    write, read = READERS[name]
    write(tmp_path / name)
    sound = (tmp_path / name).read_bytes()
    read(tmp_path / name)
    for number in range(TIMES):
        (tmp_path / name).write_bytes(mutated(sound, random.Random(f"{name} {number}")))
        try:
            read(tmp_path / name)
        except LabrigError as error:
            assert len(str(error).splitlines()) == 1, number
