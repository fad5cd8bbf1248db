"""Files that state more than they hold: refused before the memory is taken."""

import io
import json
import os
import tracemalloc
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

from labrig.foundation.array_file import read_arrays
from labrig.foundation.errors import UsageError
from labrig.foundation.input_file import read_text
from labrig.reproduce.mesh_file.read_mesh import read_mesh

FEW_BYTES = 20_000_000


def header(shape: tuple[int, ...], kind: str = "<f8") -> bytes:
    """The header of an array, without its numbers."""
    stated: dict[str, Any] = {"descr": kind, "fortran_order": False, "shape": shape}
    content = io.BytesIO()
    np.lib.format.write_array_header_1_0(content, stated)
    return content.getvalue()


def packed(path: Path, content: bytes) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("values.npy", content)


def zeros(path: Path) -> None:
    """A small file whose array is large."""
    with (
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open("values.npy", "w", force_zip64=True) as member,
    ):
        member.write(header((40, 1_000_000)))
        for _ in range(40):
            member.write(bytes(8_000_000))


def rubbish(path: Path) -> None:
    path.write_bytes(b"x" * 99)


REFUSED: dict[str, tuple[Callable[[Path], None], str]] = {
    "packed": (zeros, "more than the 250000000"),
    "lying": (lambda path: packed(path, header((10**6, 10**6))), "its header states more"),
    "objects": (lambda path: packed(path, header((2,), "|O")), "objects"),
    "no array": (lambda path: packed(path, b"x"), "magic string"),
    "no archive": (rubbish, "not a zip file"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_arrays_that_are_not_there_take_no_memory(tmp_path: Path, name: str) -> None:
    make, why = REFUSED[name]
    path = tmp_path / "made.npz"
    make(path)
    tracemalloc.start()
    with pytest.raises(UsageError, match=why):
        read_arrays(path)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < FEW_BYTES


@given(
    values=st.lists(st.floats(allow_nan=False), max_size=20),
    whole=st.lists(st.integers(-(2**31), 2**31), max_size=20),
)
def test_arrays_are_read_as_they_were_written(
    tmp_path_factory: pytest.TempPathFactory, values: list[float], whole: list[int]
) -> None:
    path = tmp_path_factory.mktemp("arrays") / "both.npz"
    np.savez_compressed(path, a=np.array(values), b=np.array(whole, dtype=np.int64).reshape(1, -1))
    arrays = read_arrays(path)
    assert arrays["a"].tolist() == values
    assert arrays["b"].tolist() == [whole]


@pytest.mark.parametrize(("count", "places"), [(99_000_000, 1), (9_000_000, 200)])
def test_a_mesh_of_more_vertices_than_fit_is_refused(
    tmp_path: Path, count: int, places: int
) -> None:
    content = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": list(range(places))}],
        "nodes": [{"mesh": 0}] * places,
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [
            {
                "componentType": 5126, "count": count, "type": "VEC3",
                "sparse": {
                    "count": 1,
                    "indices": {"bufferView": 0, "componentType": 5121},
                    "values": {"bufferView": 0},
                },
            }
        ],
        "bufferViews": [{"buffer": 0, "byteLength": 12}],
        "buffers": [{"byteLength": 12, "uri": "data:;base64,AAAAAAAAAAAAAAAA"}],
    }  # fmt: skip
    path = tmp_path / "many.gltf"
    path.write_text(json.dumps(content))
    with pytest.raises(UsageError, match="expected at most"):
        read_mesh(path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_neither_a_pipe_nor_a_device_nor_a_folder_is_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path, kind in ((tmp_path / "pipe", "a pipe"), (Path(os.devnull), "a pipe or a device")):
        with pytest.raises(UsageError, match=kind):
            read_text(path)
    with pytest.raises(UsageError, match="a folder"):
        read_text(tmp_path)
