"""Files that somebody made to do harm, and a watch over the command that opens one.

Each is a run folder, a rig, a protocol, a table, a matrix, a mesh, a picture, a frame or a scene.
None may make labrig write outside the case's own folder, start a program, open a connection, take a
gigabyte or ten seconds, or say more than a line.
"""

import io
import json
import os
import pickle
import shutil
import signal
import socket
import struct
import sys
import tempfile
import time
import zipfile
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from platformdirs import user_cache_dir

from labrig.cli.exit_codes import guarded
from tests.forked import forked

MAX_BYTES, MAX_S, HANG_S = 1 << 30, 10.0, 60.0
#: Time after which a command that serves pages is ended, as somebody does by Ctrl-C.
SERVED_S = 3.0
#: Beginnings of lines that are no complaint.
REMARKS = (
    "[",
    "note: ",
    "warning: ",
    "labrig: warning: ",
    "nothing to resume: ",
    "left out: ",
    "rig: ",
)
SERVING = ("watch", "design", "rig view", "sim camera")
#: Programs of labrig's own that it starts whatever a file says.
OWN_PROGRAMS = ("systemd-inhibit", "caffeinate")


@dataclass(frozen=True)
class Stage:
    """Place and material of the makers of hostile files.

    Attributes
    ----------
    folder
        Place of the file to be made.
    outside
        Folder of which nothing may change.
    port
        Port at which somebody listens.
    run, rig
        A sound processed run, and the rig file of it.
    """

    folder: Path
    outside: Path
    port: int
    run: Path
    rig: Path

    @property
    def mine(self) -> Path:
        return self.outside / "mine.txt"

    def file(self, name: str, content: bytes | str) -> Path:
        path = self.folder / name
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    def pipe(self, name: str) -> Path:
        os.mkfifo(self.folder / name)
        return self.folder / name

    def link(self, name: str, target: Path | str) -> Path:
        (self.folder / name).symlink_to(target)
        return self.folder / name

    def copied_run(self) -> Path:
        return Path(shutil.copytree(self.run, self.folder / "run"))


Maker = Callable[[Stage], Path]
MAKERS: dict[str, dict[str, Maker]] = {}


def of(kind: str) -> Callable[[Maker], Maker]:
    def keep(make: Maker) -> Maker:
        MAKERS.setdefault(kind, {})[make.__name__] = make
        return make

    return keep


def _rig(address: str, **more: object) -> str:
    lamp = {"driver": "serial_relay", "address": address, "on": {"send": "1"}, "off": {"send": "0"}}
    camera = {"driver": "ptp_camera", "address": "usb://04a9:3199"}
    return json.dumps({"name": "x", "devices": {"lamp": lamp, "camera": camera}, **more})


def _addresses() -> None:
    given = {
        "rig_that_empties_a_file": "spy://loop://?file={mine}",
        "rig_that_empties_a_file_in_capitals": "SPY://loop://?file={mine}",
        "rig_with_another_class": "alt:///dev/null?class=x.y",
        "rig_that_calls_a_socket": "socket://127.0.0.1:{port}",
        "rig_that_calls_a_socket_in_capitals": "Socket://127.0.0.1:{port}",
        "rig_that_calls_by_rfc2217": "rfc2217://127.0.0.1:{port}",
        "rig_that_searches_ports": "hwgrep://.*",
        "rig_that_opens_a_file_as_port": "{mine}",
        "rig_that_opens_the_null_device": "/dev/null",
    }
    for name, address in given.items():

        def make(stage: Stage, address: str = address) -> Path:
            return stage.file("rig.yaml", _rig(address.format(mine=stage.mine, port=stage.port)))

        make.__name__ = name
        of("rig")(make)


_addresses()


@of("rig")
def rig_whose_camera_is_far(stage: Stage) -> Path:
    camera = {"driver": "gphoto2_camera", "address": f"ptpip://127.0.0.1:{stage.port}"}
    return stage.file("rig.yaml", json.dumps({"name": "x", "devices": {"camera": camera}}))


@of("rig")
def rig_whose_viewfinder_is_far(stage: Stage) -> Path:
    content = json.loads(_rig("/dev/ttyACM99"))
    content["devices"]["viewfinder"] = {
        "driver": "uvc_preview", "address": f"http://127.0.0.1:{stage.port}/x.mjpg",
    }  # fmt: skip
    return stage.file("rig.yaml", json.dumps(content))


@of("rig")
def rig_whose_viewfinder_is_a_pipeline(stage: Stage) -> Path:
    content = json.loads(_rig("/dev/ttyACM99"))
    pipeline = f"videotestsrc ! filesink location={stage.mine}"
    content["devices"]["viewfinder"] = {"driver": "uvc_preview", "address": pipeline}
    return stage.file("rig.yaml", json.dumps(content))


@of("rig")
def rig_with_a_command(stage: Stage) -> Path:
    text = stage.rig.read_text()
    return stage.file("rig.yaml", f"{text}\non_finish: [touch, '{stage.outside}/started']\n")


@of("rig")
def rig_with_a_huge_sensor(stage: Stage) -> Path:
    text = stage.rig.read_text()
    return stage.file(
        "rig.yaml", text.replace("width: 96", "width: 96000").replace("height: 64", "height: 64000")
    )


@of("rig")
def rig_whose_curve_is_a_pipe(stage: Stage) -> Path:
    stage.pipe("curve.csv")
    return stage.file(
        "rig.yaml",
        f"{stage.rig.read_text()}\n".replace("optics:", "optics:\n  halogen: ./curve.csv", 1),
    )


@of("yaml")
def yaml_of_aliases(stage: Stage) -> Path:
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]" for n in range(1, 12)]
    return stage.file("aliases.yaml", "\n".join(lines))


@of("yaml")
def yaml_of_a_long_text_many_times(stage: Stage) -> Path:
    return stage.file("text.yaml", f"a: &a {'x' * 1_000_000}\nb: [{', '.join(['*a'] * 90_000)}]\n")


@of("yaml")
def yaml_of_many_values(stage: Stage) -> Path:
    return stage.file("many.yaml", f"a: [{'1,' * 2_400_000}1]\n")


@of("yaml")
def yaml_that_is_deep(stage: Stage) -> Path:
    return stage.file("deep.yaml", f"a: {'[' * 500_000}\n")


@of("yaml")
def yaml_with_code(stage: Stage) -> Path:
    return stage.file(
        "code.yaml", f"a: !!python/object/apply:os.system ['touch {stage.outside}/started']\n"
    )


@of("yaml")
def yaml_that_is_a_pipe(stage: Stage) -> Path:
    return stage.pipe("pipe.yaml")


@of("yaml")
def yaml_without_end(stage: Stage) -> Path:
    return stage.link("zero.yaml", "/dev/zero")


@of("protocol")
def protocol_of_very_many_frames(stage: Stage) -> Path:
    return stage.file(
        "protocol.yaml",
        "protocol: decay\nsample: {name: x}\ncharge: 30 s\nfor: 1000000 h\nexposure: 1/8000 s\n"
        "every: 1 ms\n",
    )


@of("protocol")
def protocol_of_very_many_repeats(stage: Stage) -> Path:
    return stage.file(
        "protocol.yaml",
        "protocol: decay\nsample: {name: x}\ncharge: 30 s\nfor: 30 s\nexposure: 1/4 s\n"
        "repeats: 1000000000\n",
    )


@of("protocol")
def protocol_with_names_that_lead_out(stage: Stage) -> Path:
    return stage.file(
        "protocol.yaml",
        f"protocol: decay\nsample: {{name: ../../..{stage.outside}/x}}\ncharge: 30 s\nfor: 30 s\n"
        f"exposure: 1/4 s\npatches:\n  ../../..{stage.outside}/p: [0.1, 0.1, 0.2, 0.2]\n",
    )


@of("table")
def table_that_is_a_pipe(stage: Stage) -> Path:
    return stage.pipe("table.csv")


@of("table")
def table_of_very_many_cells(stage: Stage) -> Path:
    return stage.file("table.csv", "t_s,value\n" + "1," * 22_000_000 + "\n")


@of("table")
def table_of_very_many_rows(stage: Stage) -> Path:
    return stage.file("table.csv", "t_s,value\n" + "1,2\n" * 12_000_000)


@of("table")
def table_without_end(stage: Stage) -> Path:
    return stage.link("table.csv", "/dev/zero")


@of("table")
def table_with_holes(stage: Stage) -> Path:
    path = stage.file("table.csv", "t_s,value\n1,2\n")
    os.truncate(path, 1 << 40)
    return path


@of("json")
def json_that_is_deep(stage: Stage) -> Path:
    return stage.file("deep.json", "[" * 1_000_000)


@of("json")
def json_of_very_many_lists(stage: Stage) -> Path:
    return stage.file("lists.json", f"[{'[],' * 6_000_000}[]]")


@of("json")
def json_of_a_long_number(stage: Stage) -> Path:
    return stage.file("number.json", "9" * 5_000_000)


def _exr(stage: Stage, name: str, side: int, tile: int | None = None) -> Path:
    """An image of zeros, whose header states another size than it has."""
    import OpenEXR

    path = stage.folder / name
    kind = OpenEXR.scanlineimage if tile is None else OpenEXR.tiledimage
    header: dict[str, Any] = {"compression": OpenEXR.ZIP_COMPRESSION, "type": kind}
    if tile is not None:
        header["tiles"] = OpenEXR.TileDescription()
    OpenEXR.File(header, {each: np.zeros((4, 4), np.float32) for each in "RGB"}).write(str(path))
    content = path.read_bytes()
    if side:
        old = struct.pack("<4i", 0, 0, 3, 3)
        content = content.replace(old, struct.pack("<4i", 0, 0, side - 1, side - 1))
    if tile is not None:
        content = content.replace(struct.pack("<2I", 32, 32), struct.pack("<2I", tile, tile))
    path.write_bytes(content)
    return path


@of("matrix")
def exr_of_stated_size(stage: Stage) -> Path:
    return _exr(stage, "size.exr", 40_000)


@of("matrix")
def exr_of_large_tiles(stage: Stage) -> Path:
    return _exr(stage, "tiles.exr", 0, 30_000)


@of("matrix")
def exr_of_zeros(stage: Stage) -> Path:
    import OpenEXR

    path = stage.folder / "zeros.exr"
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    zeros = np.zeros((6000, 6000), np.float32)
    OpenEXR.File(header, dict.fromkeys("RGB", zeros)).write(str(path))
    return path


@of("matrix")
def ark_of_a_pipe(stage: Stage) -> Path:
    return stage.pipe("paper.ark")


@of("matrix")
def bfc_of_stated_size(stage: Stage) -> Path:
    return stage.file("paper.BFC", "BFC\n1000000000 1000000000\n1 2 3\n")


def _npz(
    stage: Stage, name: str, members: dict[str, bytes], packing: int = zipfile.ZIP_DEFLATED
) -> Path:
    path = stage.folder / name
    with zipfile.ZipFile(path, "w", packing) as archive:
        for member, content in members.items():
            archive.writestr(f"{member}.npy", content)
    return path


def _npy(shape: tuple[int, ...], data: bytes = b"") -> bytes:
    stream = io.BytesIO()
    header = {"descr": "<f8", "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(stream, header)
    return stream.getvalue() + data


@of("arrays")
def npz_that_unpacks_to_gigabytes(stage: Stage) -> Path:
    return _npz(
        stage, "bomb.npz", {"values": _npy((40_000_000,), bytes(320_000_000)), "t_s": _npy((0,))}
    )


@of("arrays")
def npz_whose_header_lies(stage: Stage) -> Path:
    return _npz(stage, "lie.npz", {"values": _npy((1 << 40,)), "wavelength_nm": _npy((1 << 40,))})


@of("arrays")
def npz_with_code(stage: Stage) -> Path:
    class Code:
        def __reduce__(self) -> tuple[Any, ...]:
            return os.system, (f"touch {stage.outside}/started",)

    objects = np.array([Code()], dtype=object)
    stream = io.BytesIO()
    np.lib.format.write_array(stream, objects, allow_pickle=True)
    return _npz(
        stage, "code.npz", {name: stream.getvalue() for name in ("values", "wavelength_nm")}
    )


@of("arrays")
def npz_that_is_encrypted(stage: Stage) -> Path:
    path = _npz(stage, "locked.npz", {"values": _npy((1,), bytes(8))})
    content = bytearray(path.read_bytes())
    content[6] |= 1
    content[content.index(b"PK\x01\x02") + 8] |= 1
    path.write_bytes(content)
    return path


@of("arrays")
def npz_of_another_packing(stage: Stage) -> Path:
    path = _npz(stage, "other.npz", {"values": _npy((1,), bytes(8))})
    content = bytearray(path.read_bytes())
    content[8:10] = content[(at := content.index(b"PK\x01\x02") + 10) : at + 2] = b"\x63\0"
    path.write_bytes(content)
    return path


@of("arrays")
def npy_with_code(stage: Stage) -> Path:
    stage.file("cube.csv", "400\n500\n")
    return stage.file("cube.npy", pickle.dumps([1, 2]))


@of("arrays")
def npy_whose_header_lies(stage: Stage) -> Path:
    stage.file("cube.csv", "400\n500\n")
    return stage.file("cube.npy", _npy((1 << 30, 1 << 10, 2)))


@of("arrays")
def envi_whose_header_lies(stage: Stage) -> Path:
    stage.file("cube.raw", b"\0" * 64)
    return stage.file(
        "cube.hdr",
        "ENVI\nsamples = 30000\nlines = 30000\nbands = 2\ndata type = 4\ninterleave = bsq\n"
        "wavelength units = nm\nwavelength = {400, 500}\n",
    )


def _gltf(accessor: dict[str, object], buffer: dict[str, object]) -> str:
    return json.dumps(
        {
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
            "accessors": [{"componentType": 5126, "type": "VEC3", **accessor}],
            "bufferViews": [{"buffer": 0, "byteLength": 36}],
            "buffers": [{"byteLength": 36, **buffer}],
        }
    )  # fmt: skip


@of("mesh")
def gltf_without_data(stage: Stage) -> Path:
    return stage.file("bomb.gltf", _gltf({"count": 300_000_000}, {}))


@of("mesh")
def gltf_whose_buffer_is_a_pipe(stage: Stage) -> Path:
    stage.pipe("x.bin")
    return stage.file("pipe.gltf", _gltf({"bufferView": 0, "count": 3}, {"uri": "x.bin"}))


@of("mesh")
def gltf_whose_buffer_is_far(stage: Stage) -> Path:
    uri = f"http://127.0.0.1:{stage.port}/x.bin"
    return stage.file("far.gltf", _gltf({"bufferView": 0, "count": 3}, {"uri": uri}))


@of("mesh")
def ply_of_stated_size(stage: Stage) -> Path:
    return stage.file(
        "size.ply",
        "ply\nformat binary_little_endian 1.0\nelement vertex 2000000000\nproperty float x\n"
        "property float y\nproperty float z\nelement face 2000000000\n"
        "property list uchar int vertex_indices\nend_header\n",
    )


@of("mesh")
def stl_of_stated_size(stage: Stage) -> Path:
    return stage.file("size.stl", bytes(80) + struct.pack("<I", 0xFFFFFFFF) + bytes(50))


@of("mesh")
def obj_that_is_a_pipe(stage: Stage) -> Path:
    return stage.pipe("pipe.obj")


@of("mesh")
def obj_of_many_corners(stage: Stage) -> Path:
    return stage.file("many.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf " + "1 2 3 " * 3_000_000 + "\n")


def _png(width: int, height: int) -> bytes:
    def chunk(kind: bytes, data: bytes) -> bytes:
        return (
            struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        )

    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    data = zlib.compress(bytes(1 << 20))
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", data) + chunk(b"IEND", b"")


@of("picture")
def png_of_stated_size(stage: Stage) -> Path:
    return stage.file("size.png", _png(30_000, 30_000))


@of("picture")
def png_that_is_a_pipe(stage: Stage) -> Path:
    return stage.pipe("pipe.png")


@of("picture")
def tiff_of_stated_size(stage: Stage) -> Path:
    return stage.file("size.tif", _tiff(30_000, 30_000))


@of("picture")
def picture_of_another_kind(stage: Stage) -> Path:
    return stage.file("picture.png", f"P6 30000 30000 255\n{'x' * 100}")


def _tiff(width: int, height: int, *more: tuple[int, int, int, int]) -> bytes:
    """A TIFF of one strip of few bytes, with the tags of a DNG among `more`."""
    tags = sorted(
        [
            (254, 4, 1, 0), (256, 4, 1, width), (257, 4, 1, height), (258, 3, 1, 16),
            (259, 3, 1, 1), (262, 3, 1, 1), (273, 4, 1, 8), (277, 3, 1, 1), (278, 4, 1, height),
            (279, 4, 1, min(width * height * 2, 0xFFFFFFFF)),
            *more,
        ]
    )  # fmt: skip
    tags = list({tag[0]: tag for tag in tags}.values())
    body = struct.pack("<H", len(tags))
    body += b"".join(struct.pack("<HHII", *tag) for tag in tags) + struct.pack("<I", 0)
    return struct.pack("<2sHI", b"II", 42, 8) + body


_DNG = (
    (50706, 1, 4, 0x00000401), (262, 3, 1, 32803), (33421, 3, 2, 0x00020002),
    (33422, 1, 4, 0x02010100), (50708, 2, 4, 0x00786878),
)  # fmt: skip


@of("frame")
def dng_of_stated_size(stage: Stage) -> Path:
    return stage.file("size.dng", _tiff(30_000, 30_000, *_DNG))


@of("frame")
def dng_of_many_tags(stage: Stage) -> Path:
    more = [(tag, 2, 0xFFFFFFF0, 8) for tag in (271, 272, 305, 50714, 50715, 33432)]
    return stage.file("tags.dng", _tiff(64, 64, *_DNG, *more))


@of("frame")
def dng_that_leads_to_itself(stage: Stage) -> Path:
    return stage.file("loop.dng", _tiff(64, 64, *_DNG, (330, 4, 1, 8), (34665, 4, 1, 8)))


@of("frame")
def frame_that_is_a_pipe(stage: Stage) -> Path:
    return stage.pipe("frame.dng")


@of("frame")
def frame_that_is_packed(stage: Stage) -> Path:
    return stage.file("frame.dng", b"\x1f\x8b\x08" + zlib.compress(bytes(1 << 24)))


SCENE = """
name: hostile
kind: scene
materials:
  white: {{albedo: 0.75}}
  paint: {paint}
lamps: {{ceiling: {{kind: area, spectrum: {light}, luminance_cd_per_m2: 10000}}}}
objects:
  thing: {thing}
  lamp:
    lamp: ceiling
    rectangle: {{corner_m: [0.35, 0.4, 1], edge_u_m: [0, 0.2, 0], edge_v_m: [0.3, 0, 0]}}
camera: {{position_m: [0.5, -1.4, 0.5], look_at_m: [0.5, 0, 0.5], vertical_fov_deg: 40, {size}}}
programme: [{{at_s: -600, lamps: {{ceiling: 1}}}}, {{at_s: 0, lamps: {{ceiling: 0}}}}]
frames_s: [-1]
"""
RECTANGLE = "rectangle: {corner_m: [0, 0, 0], edge_u_m: [1, 0, 0], edge_v_m: [0, 1, 0]}"


def scene_with(
    thing: str = RECTANGLE, paint: str = "{albedo: 0.5}", light: str = "D65",
    size: str = "width_px: 8, height_px: 8",
) -> str:  # fmt: skip
    """A scene that names a file."""
    return SCENE.format(thing=f"{{material: paint, {thing}}}", paint=paint, light=light, size=size)


def scenes_of(file: Path) -> dict[str, str]:
    """Scenes that name a file in each way in which one can, whatever it is."""
    name = json.dumps(str(file))
    phosphor = "file: blue-paint, assume_albedo: 0.7, assume_scale: 0.2"
    return {
        "mesh": scene_with(f"mesh: {{file: {name}}}"),
        "particles": scene_with(f"particles: {{file: {name}, radius_m: 0.1}}"),
        "vertices": scene_with(f"{RECTANGLE}, vertices_over_time: {name}"),
        "picture": scene_with(
            f'{RECTANGLE}, material_map: {{file: {name}, materials: {{"#000000": white}}}}'
        ).replace("material: paint, ", "", 1),
        "texture": scene_with(paint=f"{{{phosphor}, texture: {name}}}"),
        "material": scene_with(paint=f"{{file: {name}}}"),
        "mixture": scene_with(paint=f"{{albedo: 0.5, mixture: {name}}}"),
        "albedo": scene_with(paint=f"{{albedo: {name}}}"),
        "light": scene_with(light=name),
    }


@of("scene")
def scene_of_stated_size(stage: Stage) -> Path:
    return stage.file("scene.yaml", scene_with(size="width_px: 200000, height_px: 200000"))


@of("scene")
def scene_of_very_many_texels(stage: Stage) -> Path:
    return stage.file("scene.yaml", scene_with(f"{RECTANGLE}, samples: [100000, 100000]"))


@of("queue")
def queue_whose_lock_leads_out(stage: Stage) -> Path:
    stage.link(".queue.yaml.lock", stage.mine)
    stage.link(".queue.yaml.draft", stage.mine)
    stage.link(".queue.yaml.running", stage.mine)
    return stage.file("queue.yaml", "runs: [{protocol: decay, rig: sim}]\n")


@of("runs")
def runs_whose_index_leads_out(stage: Stage) -> Path:
    stage.link(".runs-index", stage.mine)
    stage.link("calibrations", stage.outside)
    shutil.copytree(stage.run, stage.folder / "run")
    return stage.folder


@of("runs")
def runs_with_pipes(stage: Stage) -> Path:
    stage.pipe(".runs-index")
    copy = stage.copied_run()
    for name in ("made.txt", "notes.md", "result/summary.txt"):
        (copy / name).unlink(missing_ok=True)
        os.mkfifo(copy / name)
    return stage.folder


def _runs() -> None:
    linked = ("cache", ".process.holder", "log.txt", "frames", "notes.md", "result/figures",
              "result", "journal.jsonl", "result.part", "comparison", ".lock")  # fmt: skip
    for name in linked:

        def make(stage: Stage, name: str = name) -> Path:
            place = stage.copied_run() / name
            target = stage.outside if "." not in name.strip(".") else stage.mine
            if place.is_dir() and not place.is_symlink():
                shutil.rmtree(place)
            place.unlink(missing_ok=True)
            place.symlink_to(target)
            return stage.folder / "run"

        make.__name__ = f"run_whose_{name.strip('.').replace('.', '_').replace('/', '_')}_leads_out"
        of("run")(make)


_runs()


@of("run")
def run_with_a_command(stage: Stage) -> Path:
    run = stage.copied_run()
    rig = run / "rig.yaml"
    rig.write_text(
        rig.read_text().replace("on_finish: null", "")
        + f"\non_finish: [touch, '{stage.outside}/started']\n"
    )
    return run


@of("run")
def run_whose_journal_has_no_end(stage: Stage) -> Path:
    run = stage.copied_run()
    os.truncate(run / "journal.jsonl", 1 << 40)
    return run


@of("run")
def run_whose_result_is_deep(stage: Stage) -> Path:
    run = stage.copied_run()
    for name in ("result.json", "fit.json"):
        (run / "result" / name).write_text('{"kind": ' + "[" * 1_000_000)
    return run


@of("run")
def run_with_names_that_lead_out(stage: Stage) -> Path:
    run = stage.copied_run()
    path = run / "protocol.yaml"
    path.write_text(path.read_text().replace("name: test", f"name: ../../..{stage.outside}/x"))
    return run


@of("folder")
def folder_with_modules(stage: Stage) -> Path:
    code = f"open({str(stage.outside / 'started')!r}, 'w')\n"
    for name in ("typer", "numpy", "yaml", "labrig", "cv2", "sitecustomize"):
        stage.file(f"{name}.py", code)
    stage.file(".numba_config.yaml", "CACHE_DIR: /nowhere\n")
    return stage.file("table.csv", "t_s,value\n1,2\n2,1\n3,0.5\n")


@of("out")
def folder_of_results_that_lead_out(stage: Stage) -> Path:
    for name in ("result", "result.part", "figures", "scene.json", "fit.json", "report.html"):
        stage.link(name, stage.outside if "." not in name or "part" in name else stage.mine)
    return stage.folder


@dataclass(frozen=True)
class Outcome:
    """End of a command on a hostile file.

    Attributes
    ----------
    wrong
        What went wrong; nothing if all held.
    code
        Exit code.
    took_s, peak_bytes
        Time of computing, and largest memory.
    lines
        Complaints.
    """

    code: int
    took_s: float
    peak_bytes: int
    lines: tuple[str, ...]
    wrong: tuple[str, ...] = field(default=())


class Listener:
    """Somebody at a port of this PC, who counts the calls."""

    def __init__(self) -> None:
        self._server = socket.create_server(("127.0.0.1", 0))
        self._server.setblocking(False)
        self.port = int(self._server.getsockname()[1])

    def called(self) -> bool:
        """Return whether somebody called since this was asked last."""
        calls = 0
        while True:
            try:
                connection, _ = self._server.accept()
            except BlockingIOError:
                return calls > 0
            connection.close()
            calls += 1

    def close(self) -> None:
        self._server.close()


def snapshot(folder: Path) -> dict[str, tuple[int, int, bytes]]:
    """Return all names in a folder with kind, time of change and content."""
    found = {}
    for path in sorted([folder, *folder.rglob("*")]):
        status = path.lstat()
        content = path.read_bytes() if path.is_file() else b""
        found[str(path)] = (status.st_mode, status.st_mtime_ns, content)
    return found


def opened(command: Sequence[str], stage: Stage, listener: Listener, home: Path) -> Outcome:
    """Run a command on a hostile file in a process of its own, under watch."""
    is_served = " ".join(command).startswith(SERVING)
    return watched(
        lambda: guarded([str(word) for word in command]), is_served, stage, listener, home
    )


def watched(
    run: Callable[[], int], is_served: bool, stage: Stage, listener: Listener, home: Path
) -> Outcome:
    """Return how a function ended in a process of its own, and what it did that it may not."""
    before = snapshot(stage.outside)
    listener.called()
    deeds, said = home / "deeds.txt", home / "said.txt"
    deeds.write_text("")

    def run_there() -> int:
        os.environ |= {"HOME": str(home), "XDG_CONFIG_HOME": str(home / "settings")}
        os.chdir(home)
        sys.stderr = os.fdopen(os.dup(2), "w")  # in a test, it is held back
        sys.dont_write_bytecode = True
        tempfile.tempdir = str(home)
        _watch(deeds, (home, stage.folder, stage.run.parent))
        return run()

    pid = forked(run_there, said)
    code, took_s, peak_bytes, hung = _awaited(pid, is_served)
    lines = tuple(
        line for line in said.read_text(errors="replace").splitlines()
        if not line.startswith(REMARKS) and line.strip()
    )  # fmt: skip
    wrong = [*dict.fromkeys(deeds.read_text().splitlines())]
    if snapshot(stage.outside) != before:
        wrong.append("something outside was changed")
    if listener.called():
        wrong.append("somebody was called")
    if hung:
        wrong.append(f"did not end within {HANG_S:g} s")
    if took_s > MAX_S:
        wrong.append(f"took {took_s:.1f} s")
    if peak_bytes > MAX_BYTES:
        wrong.append(f"took {peak_bytes / 1e6:.0f} MB")
    if any("Traceback" in line or "a fault in labrig" in line for line in lines):
        wrong.append("a fault")
    if code in (2, 3, 4, 5) and len(lines) != 1:
        wrong.append(f"{len(lines)} lines")
    if code not in (0, 2, 3, 4, 5, 130, -signal.SIGINT):
        wrong.append(f"exit code {code}")
    return Outcome(code, took_s, peak_bytes, lines, tuple(wrong))


def _awaited(pid: int, serves: bool) -> tuple[int, float, int, bool]:
    """Exit code, seconds of computing, largest memory in bytes, and whether it hung."""
    began, hung, asked = time.monotonic(), False, False
    while True:
        done, status, used = os.wait4(pid, os.WNOHANG)
        if done:
            code = os.waitstatus_to_exitcode(status)
            return code, used.ru_utime + used.ru_stime, used.ru_maxrss * 1024, hung
        waited_s = time.monotonic() - began
        if serves and waited_s > SERVED_S and not asked:
            os.kill(pid, signal.SIGINT)
            asked = True
        if waited_s > HANG_S and not hung:
            os.kill(pid, signal.SIGKILL)
            hung = True
        time.sleep(0.002)


#: Events of Python's audit by which something is changed, with the places of the paths.
_CHANGES = {
    "os.rename": (0, 1), "os.remove": (0,), "os.mkdir": (0,), "os.rmdir": (0,), "os.link": (1,),
    "os.symlink": (1,), "os.truncate": (0,), "os.chmod": (0,), "shutil.rmtree": (0,),
}  # fmt: skip
_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC


def _watch(deeds: Path, folders: tuple[Path, ...]) -> None:
    """Write down what this process does beyond its folders, by Python's audit."""
    out = os.open(deeds, os.O_WRONLY | os.O_APPEND)
    own = (*folders, Path("/dev"), Path("/run/lock"), Path(user_cache_dir("labrig")))
    permitted = tuple(str(place.resolve()) for place in own)

    def note(text: str) -> None:
        os.write(out, f"{text}\n".encode(errors="replace"))

    def is_outside(path: object) -> bool:
        if not isinstance(path, str | bytes | os.PathLike):
            return False
        name = Path(os.fsdecode(path))
        return not str(name.parent.resolve() / name.name).startswith(permitted)

    def hook(event: str, arguments: tuple[Any, ...]) -> None:
        if event == "open" and isinstance(arguments[2], int) and arguments[2] & _WRITING:
            if is_outside(arguments[0]):
                note(f"opened {arguments[0]} for writing")
        elif event in _CHANGES:
            for place in _CHANGES[event]:
                if is_outside(arguments[place]):
                    note(f"{event} {arguments[place]}")
        elif event == "subprocess.Popen":
            program, words = arguments[0], [os.fsdecode(each) for each in arguments[1]]
            is_own = os.fsdecode(program) == sys.executable and words[1:3] == ["-P", "-m"]
            if not is_own and Path(words[0]).name not in OWN_PROGRAMS:
                note(f"started {words}")
        elif event in ("os.system", "os.exec", "os.posix_spawn"):
            note(f"{event} {arguments[0]}")
        elif event == "socket.connect":
            note(f"called {arguments[1]}")

    sys.addaudithook(hook)
