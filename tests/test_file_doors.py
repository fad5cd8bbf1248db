"""Files, programs, networks and code are reached through a few modules, the doors, and no others.

What somebody else sent is opened on a PC that can switch a lamp. Each door does no more than to
open it: a call or an import of the kinds below anywhere else fails here, and is moved behind a
door.
"""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

HOME = Path(__file__).parents[1]
#: Modules through which a kind of thing is reached, by the calls and imports of that kind.
DOORS: dict[str, tuple[set[str], set[str]]] = {
    "read a file": (
        {"open", "io.open", "os.open", "os.fdopen", "*.open", "*.read_text", "*.read_bytes"},
        {
            "labrig/foundation/input_file.py",
            "labrig/foundation/output_file.py",
            "labrig/record/journal.py",  # appends to its own file, in a folder that was checked
            "labrig/foundation/exr_file.py",  # the null device, for what OpenEXR prints
            "labrig/bench/device_lock.py",  # locks of all users, not followed through links
            "labrig/acquire/running_programs.py",  # of the system: /proc
            "labrig/cli/detachable_stream.py",  # the null device
            "labrig/bench/guard_process.py",  # the null device
            "labrig/reduce/workers/process.py",  # its own standard output
        },
    ),
    "write a file": (
        {
            "*.write_text", "*.write_bytes", "*.touch", "Path.replace", "*.symlink_to",
            "*.hardlink_to", "os.link",
            "os.symlink", "*.rename", "os.replace", "shutil.copy", "shutil.copyfile",
            "shutil.copytree", "shutil.move", "*.tofile", "*.savetxt", "*.extractall",
        },
        {
            "labrig/foundation/output_file.py",
            "labrig/process/run.py",  # names of whole folders of results
            "labrig/calibration/kept.py",  # and of calibrations
        },
    ),
    "make or delete a folder": (
        {"*.mkdir", "os.makedirs", "*.rmdir", "shutil.rmtree", "*.unlink", "os.remove"},
        {
            "labrig/foundation/output_file.py",
            "labrig/record/run_folder.py",
            "labrig/record/checksums.py",
            "labrig/process/run.py",
            "labrig/calibration/kept.py",
            "labrig/reproduce/compiled.py",
            "labrig/bench/device_lock.py",
            "labrig/cli/default_rig.py",
            "labrig/setup/patches_block.py",
            "labrig/reduce/workers/kept.py",
        },
    ),
    "read or write arrays": (
        {
            "np.load", "np.fromfile", "np.memmap", "np.genfromtxt", "np.save", "np.savez",
            "np.savez_compressed",
        },
        {"labrig/foundation/array_file.py"},
    ),
    "read a picture": (
        {"cv2.imread", "cv2.imdecode", "cv2.imreadmulti", "cv2.VideoCapture", "cv2.FileStorage"},
        {"labrig/foundation/picture_file.py", "drivers/uvc_preview.py"},
    ),
    "write a picture": (
        {"cv2.imwrite", "cv2.VideoWriter", "*.savefig", "PdfPages"},
        # Into memory.
        {
            "labrig/report/figure_files.py",
            "labrig/report/notebook_figure.py",
        },
    ),
    "parse YAML": (
        {"yaml.load", "yaml.safe_load", "yaml.load_all"},
        {"labrig/foundation/yaml_file.py"},
    ),
    "lock a file": (
        {"FileLock", "SoftFileLock"},
        {"labrig/foundation/file_lock.py", "labrig/bench/device_lock.py"},
    ),
    "run code": (
        {
            "eval", "exec", "__import__", "*.exec_module", "*.import_module", "import_module",
            "resolve_name", "*.resolve_name",
            "runpy.run_path", "os.system", "os.popen", "os.execv", "os.startfile", "*.loads_pickle",
        },
        # By names that are written there.
        {
            "labrig/foundation/plugins.py",
            "labrig/foundation/notebook_views.py",
            "labrig/results/run_result.py",
            "labrig/reproduce/compiled.py",
            "labrig/reduce/workers/kept.py",
        },
    ),
}  # fmt: skip
#: Calls of that name on what is no file.
NO_FILES = {
    "door.open", "port.open", "device.open", "session.open", "self.open", "self._bulb.open",
    "bench.open", "RenderFolder.open", "webbrowser.open", "archive.open", "Image.open",
}  # fmt: skip
#: Modules that may be imported by some only.
IMPORTS: dict[tuple[str, ...], set[str]] = {
    ("subprocess",): {
        "labrig/acquire/running_programs.py",  # ps
        "labrig/bench/awake.py",  # systemd-inhibit, caffeinate
        "labrig/foundation/own_process.py",  # labrig itself
        # their streams and ends
        "labrig/bench/guard.py",
        "labrig/process/ahead.py",
        "labrig/reduce/workers/pool.py",
        "labrig/watch/previews.py",
        "labrig/cli/on_finish.py",  # by consent
        "labrig/reproduce/picture/video.py",  # ffmpeg
        "drivers/gphoto2_camera/process.py",  # labrig itself
    },
    ("socket",): {
        "labrig/bench/opening.py",  # by consent
        "labrig/bench/device_lock.py",
        "labrig/record/run_folder.py",  # the name of this PC
        "labrig/acquire/connections.py",  # the type
        "sim/camera/ptpip/server.py",
    },
    (
        "urllib.request",
        "http.client",
        "ftplib",
        "smtplib",
        "requests",
        "xmlrpc",
        "telnetlib",
    ): set(),
    ("http.server", "socketserver"): {"labrig/local_server.py"},
    ("pickle",): {"labrig/reduce/workers/pool.py", "labrig/reduce/workers/process.py"},
    ("marshal", "shelve", "dbm", "dill", "joblib", "cloudpickle"): set(),
    ("multiprocessing",): {
        "drivers/gphoto2_camera/process.py",  # a pipe to labrig itself
        "drivers/gphoto2_camera/helper.py",
    },
    ("ctypes",): {
        "labrig/foundation/clock.py",
        "labrig/foundation/signals.py",
        "labrig/bench/awake.py",
    },
    ("gzip", "bz2", "lzma", "tarfile"): set(),
    ("zipfile",): {"labrig/foundation/array_file.py"},
    ("OpenEXR",): {"labrig/foundation/exr_file.py"},
    ("PIL",): {"labrig/foundation/picture_file.py"},
    ("rawpy",): {"labrig/reduce/raw.py", "labrig/process/provenance.py"},  # there its version
    ("tifffile",): {"labrig/reduce/dng.py", "labrig/export/image_stack.py"},
    ("exifread",): {"labrig/reduce/raw.py", "labrig/setup/check.py"},  # there of the own camera
    ("h5py",): {"labrig/export/nexus.py"},
    ("yaml",): {
        "labrig/foundation/yaml_file.py",
        "labrig/setup/patches_block.py",
    },  # there where a key stands
    ("serial",): {
        "labrig/bench/opening.py",
        "labrig/bench/serial_ports.py",  # a list of the ports
        "labrig/setup/host.py",  # a list of the ports
        "drivers/serial_line.py",  # its exceptions
        "sim/protocol_sim.py",  # the simulated port
    },
    ("webbrowser",): {"labrig/cli/page.py"},
    ("tempfile",): {  # folders and files of their own, of random names
        "labrig/compare/rendered.py",
        "labrig/compare/rendered_lamps.py",
        "labrig/process/run.py",
        "labrig/studio/workbench.py",
        "labrig/studio/scene_bench.py",
        "labrig/reproduce/picture/video.py",
        "labrig/reduce/raw.py",
        "labrig/cli/exit_codes.py",
    },
    ("xml.etree", "xml.dom", "xml.sax", "lxml"): {"labrig/reproduce/export/mitsuba_scene.py"},
    ("os.open", "os.fdopen", "os.system", "os.popen", "io.open", "shutil.rmtree"): set(),
}


#: Last words of such calls and of such imports; a source without any of them is not parsed.
CALLED = {each.rpartition(".")[2] for patterns, _ in DOORS.values() for each in patterns}
IMPORTED = {each.partition(".")[0] for names in IMPORTS for each in names}
WORDS = re.compile(
    rf"\b(?:{'|'.join(sorted(CALLED))})\s*\("
    rf"|\b(?:import|from)\b.*\b(?:{'|'.join(sorted(IMPORTED))})\b"
)


def modules() -> Iterator[Path]:
    """Paths of the product's modules from the repository's root."""
    for folder in ("labrig", "drivers", "protocols", "sim"):
        for path in (HOME / folder).rglob("*.py"):
            inside = path.relative_to(HOME)
            # Installed for editing, the folders beside are links in labrig.
            if not (
                inside.parts[0] == "labrig" and (HOME / "labrig" / inside.parts[1]).is_symlink()
            ):
                yield inside


def calls(tree: ast.AST) -> Iterator[tuple[int, str]]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and _last_word(node.func) in CALLED:
            name = ast.unparse(node.func)
            if name.endswith(".replace") and len(node.args) == 1 and not node.keywords:
                name = "Path.replace"  # that of a text has two
            yield node.lineno, name


def _last_word(called: ast.expr) -> str:
    return called.attr if isinstance(called, ast.Attribute) else getattr(called, "id", "")


def imports(tree: ast.AST) -> Iterator[tuple[int, str]]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, name.name) for name in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            yield from ((node.lineno, f"{node.module}.{name.name}") for name in node.names)


def is_of(name: str, patterns: set[str]) -> bool:
    return name in patterns or ("." in name and f"*.{name.rpartition('.')[2]}" in patterns)


@cache
def reached(source: str) -> list[tuple[str, str, frozenset[str]]]:
    return list(_reached(source))


def _reached(source: str) -> Iterator[tuple[str, str, frozenset[str]]]:
    """Yield place and kind of what a module reaches, and the doors to it."""
    if WORDS.search(source) is None:
        return
    tree = ast.parse(source)
    for line, name in calls(tree):
        for kind, (patterns, doors) in DOORS.items():
            if is_of(name, patterns) and name not in NO_FILES:
                yield f"{line}: {name}", kind, frozenset(doors)
    for line, name in imports(tree):
        for names, doors in IMPORTS.items():
            if any(f"{name}.".startswith(f"{each}.") for each in names):
                yield f"{line}: import of {name}", names[0], frozenset(doors)


def past_doors(source: str, module: str) -> list[str]:
    return [
        f"{module}:{place}, to {kind}"
        for place, kind, doors in reached(source)
        if module not in doors
    ]


@pytest.fixture(scope="module")
def sources() -> dict[str, str]:
    return {path.as_posix(): (HOME / path).read_text(encoding="utf-8") for path in modules()}


def test_nothing_is_reached_past_the_doors(sources: dict[str, str]) -> None:
    past = [line for module, source in sources.items() for line in past_doors(source, module)]
    assert not past, "\n".join(past)


def test_every_door_is_needed(sources: dict[str, str]) -> None:
    listed = {(kind, module) for kind, (_, doors) in DOORS.items() for module in doors}
    listed |= {(names[0], module) for names, doors in IMPORTS.items() for module in doors}
    used = {
        (kind, module) for kind, module in listed for _, each, _ in reached(sources[module])
        if each == kind
    }  # fmt: skip
    assert listed == used


@pytest.mark.parametrize(
    "line",
    [
        "open('x')", "path.open()", "(folder / name).read_text()", "path.write_bytes(b'')",
        "io.open('x')", "np.load('x.npy')", "cv2.imwrite('x.png', picture)", "figure.savefig('x')",
        "yaml.safe_load(text)", "FileLock('x')", "exec(text)", "importlib.import_module(name)",
        "resolve_name(name)",
        "shutil.copytree(a, b)", "path.mkdir()", "os.system('x')", "import subprocess",
        "from urllib.request import urlopen", "import pickle", "draft.replace(path)",
        "import h5py", "from PIL import Image", "from os import open as look", "import rawpy",
    ],
)  # fmt: skip
def test_a_new_way_past_them_is_named(line: str) -> None:
    assert list(past_doors(line, "labrig/report/new.py"))


@pytest.mark.parametrize(
    "line",
    ["door.open()", "read_text(path)", "text.replace('a', 'b')", "import os", "np.loadtxt(lines)"],
)
def test_what_is_none_is_let_through(line: str) -> None:
    assert not list(past_doors(line, "labrig/report/new.py"))
