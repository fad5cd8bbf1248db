"""What many tests need: small simulated rigs, quick protocols, the command line in process."""
# ruff: noqa: E402  (what has to be said before imports stands before them)

import os
import sys

# As the command line does; has to be said before numpy is loaded.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# What one process has compiled, the many that tests start need not compile again; has to be said
# before anything large is loaded, since this process is the first.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# Modules and tests are no garbage: the collector looks for it once all of them are there.
import gc

gc.disable()

import logging
import signal
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from filelock import FileLock
from hypothesis import settings

# A job in the background of a script ignores Ctrl-C, and so would labrig and all that tests start;
# has to be said before labrig looks at it.
for _name in ("SIGINT", "SIGQUIT", "SIGHUP"):
    _signum = getattr(signal, _name, None)
    if _signum is not None and signal.getsignal(_signum) == signal.SIG_IGN:
        signal.signal(_signum, signal.default_int_handler if _name == "SIGINT" else signal.SIG_DFL)

from labrig.foundation.signals import STOP_SIGNALS
from tests.quick_yaml import read_quickly, write_quickly
from tests.real_data import REAL, SHARED

# Tests write thousands of files, which some disks take longer to delete than to write:
# where the memory is a file system that runs programs, too, they are there.
MEMORY = Path("/dev/shm")
if MEMORY.is_dir() and sys.platform == "linux":
    _memory = os.statvfs(MEMORY)
    if _memory.f_bavail * _memory.f_frsize > 4e9 and not _memory.f_flag & os.ST_NOEXEC:
        os.environ.setdefault("PYTEST_DEBUG_TEMPROOT", str(MEMORY))

# What takes long to import is imported where it is used: the process that hands out the tests,
# and begins before the others, needs none of it.
if TYPE_CHECKING:
    from selenium.webdriver import Chrome

    from labrig.report.figure_files import FigureFiles
    from labrig.report.page import RenderedSection
    from labrig.report.sections import Picture, Section

    Draw = Callable[[Sequence[Section], FigureFiles], list[RenderedSection]]

# As Python sets it, the collector takes a tenth of the time of all tests.
gc.set_threshold(20_000, 10, 10)
SYNC = os.fsync
PRESENT = pytest.StashKey[pytest.Item]()
HANDLERS = {signum: signal.getsignal(signum) for signum in STOP_SIGNALS}

# In CI the same examples every time, so that a red run is about the change; elsewhere new ones.
settings.register_profile("ci", derandomize=True, max_examples=15, deadline=None)
settings.register_profile("default", max_examples=15, deadline=None)
settings.load_profile("ci" if os.environ.get("CI") else "default")


@dataclass(frozen=True)
class Ended:
    """Ending of a command, and what it printed."""

    code: int
    out: str
    err: str

    @property
    def run_folder(self) -> Path:
        return Path(self.out.splitlines()[-1])


@pytest.fixture
def labrig(capfd: pytest.CaptureFixture[str]) -> Callable[..., Ended]:
    """Runs `labrig ARGUMENTS…` in this process."""
    from labrig.cli.exit_codes import guarded

    def run(*arguments: object) -> Ended:
        capfd.readouterr()
        code = guarded([str(argument) for argument in arguments])
        printed = capfd.readouterr()
        return Ended(code, printed.out, printed.err)

    return run


def pytest_collection_finish() -> None:
    """Begin to collect garbage, and never look at modules and thousands of tests."""
    gc.freeze()
    gc.enable()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark what needs shared data, leave campaigns to whom asks for them, put browsers first.

    A browser is then started by one worker and not by each.
    """
    for item in items:
        if "shared_data" in getattr(item, "fixturenames", ()):
            item.add_marker("shared_data")
    if "campaign" not in config.option.markexpr:
        campaigns = [item for item in items if item.get_closest_marker("campaign")]
        config.hook.pytest_deselected(items=campaigns)
        items[:] = [item for item in items if item not in set(campaigns)]
    items.sort(key=lambda item: "chromium" not in getattr(item, "fixturenames", ()))


def pytest_xdist_auto_num_workers() -> int:
    """Half as many again as there are processors: a third of the time tests wait for processes."""
    return max(1, 3 * (os.cpu_count() or 1) // 2)


@pytest.fixture(scope="session")
def real_data() -> Path:
    """Real measured data of the repository."""
    return REAL


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Real measured data that may not be copied; its tests have the marker of the same name.

    Nothing else is skipped for want of data.
    """
    if not SHARED.is_dir():
        pytest.skip(f"needs the real measured data in {SHARED}")
    return SHARED


@pytest.fixture(scope="session", autouse=True)
def shared_recordings(tmp_path_factory: pytest.TempPathFactory) -> None:
    """One folder of recorded runs for all workers."""
    from tests.analyse import recorded

    of_worker = tmp_path_factory.getbasetemp()
    is_worker = "PYTEST_XDIST_WORKER" in os.environ
    recorded.SHARED = (of_worker.parent if is_worker else of_worker) / "recorded"
    recorded.SHARED.mkdir(exist_ok=True)


@pytest.fixture(scope="session", autouse=True)
def compiled_once(shared_recordings: None) -> Iterator[None]:
    """Kernels that one worker compiles are awaited and loaded by the others."""
    from numba.core.compiler_lock import global_compiler_lock
    from numba.core.dispatcher import Dispatcher

    from tests.analyse import recorded

    assert recorded.SHARED is not None
    alone = FileLock(recorded.SHARED / "compiled.lock")
    compile_kernel = Dispatcher.compile

    def compile_alone(kernel: Dispatcher, signature: object) -> object:
        # Threads take the locks in the order in which a kernel that calls another one does.
        with global_compiler_lock, alone:
            return compile_kernel(kernel, signature)

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(Dispatcher, "compile", compile_alone)
        yield


@pytest.fixture(autouse=True)
def answered_signals() -> Iterator[None]:
    """A command that ended ignores signals, as would all processes that later tests start."""
    _answer_signals()
    yield
    _answer_signals()


def _answer_signals() -> None:
    for signum, handler in HANDLERS.items():
        if signal.getsignal(signum) is not handler:
            signal.signal(signum, handler)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Remember the present test, for what its markers say of what its fixtures do, too."""
    item.config.stash[PRESENT] = item


@pytest.fixture(scope="session", autouse=True)
def undrawn(pytestconfig: pytest.Config) -> Iterator[None]:
    """Figures take longer than all else: only tests marked `drawn` draw them.

    Those of `tests/analyse` and `tests/recordings`, where every protocol has one, make them.
    """
    from matplotlib.figure import Figure

    from labrig.report import page

    draw, save = page.draw, Figure.savefig

    def is_drawn() -> bool:
        return pytestconfig.stash[PRESENT].get_closest_marker("drawn") is not None

    def draw_if_asked(
        sections: "Sequence[Section]", figure_files: "FigureFiles"
    ) -> "list[RenderedSection]":
        is_made = {"analyse", "recordings"} & set(pytestconfig.stash[PRESENT].path.parts)
        drawn = draw if is_drawn() or is_made else partial(_draw_blank, draw)
        return drawn(sections, figure_files)

    def save_if_asked(figure: Figure, file: Any, *arguments: Any, **keys: Any) -> None:
        (save if is_drawn() else _leave_blank)(figure, file, *arguments, **keys)

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(page, "draw", draw_if_asked)
        patched.setattr(Figure, "savefig", save_if_asked)
        yield


@pytest.fixture(scope="session", autouse=True)
def unsynced() -> Iterator[None]:
    """Files are not synced: nobody pulls the plug. `tests/record` has the tests that ask for it."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("os.fsync", lambda handle: None)
        yield


@pytest.fixture(scope="session", autouse=True)
def unlogged() -> None:
    """Runs log no transactions of their devices: that takes a tenth of a recording.

    Tests that ask for them use `logged`.
    """
    logging.getLogger("labrig.drivers").setLevel(logging.INFO)


@pytest.fixture
def logged() -> Iterator[None]:
    """What goes over the wires is logged, as it is in the field."""
    logger = logging.getLogger("labrig.drivers")
    level = logger.level
    logger.setLevel(logging.NOTSET)
    yield
    logger.setLevel(level)


def _leave_blank(figure: object, file: object, format: str = "", **_: object) -> None:
    if format == "svg":
        assert isinstance(file, BytesIO)
        file.write(b'<svg viewBox="0 0 1 1"></svg>')


def _draw_blank(
    draw: "Draw", sections: "Sequence[Section]", figure_files: "FigureFiles"
) -> "list[RenderedSection]":
    blank = [replace(one, figures=tuple(map(_blank, one.figures))) for one in sections]
    return draw(blank, figure_files)


def _blank(picture: "Picture") -> "Picture":
    from matplotlib.figure import Figure

    return replace(picture, drawing=Figure) if callable(picture.drawing) else picture


@pytest.fixture
def make_rig(tmp_path: Path) -> Callable[..., Path]:
    """Writes the shipped simulated rig with a small sensor, changed as told."""

    def write(name: str = "rig.yaml", base: str = "sim", **simulation: object) -> Path:
        return write_small_rig(tmp_path / name, base, **simulation)

    return write


def write_small_rig(path: Path, base: str = "sim", **simulation: object) -> Path:
    """Write the shipped simulated rig with a small sensor, changed as told."""
    from labrig.foundation import resources

    content = read_quickly((resources.folder("config") / f"{base}.yaml").read_text())
    content["simulation"] |= {"sensor": {"width": 96, "height": 64}}
    # PyYAML takes these two for a date and a truth value, as labrig's loader does not.
    content["simulation"] |= {"epoch": "2026-01-01T00:00:00Z", "initial": {"lamp": "off"}}
    content["simulation"] |= simulation
    path.write_text(write_quickly(content), encoding="utf-8")
    return path


@pytest.fixture
def make_protocol(tmp_path: Path) -> Callable[..., Path]:
    """Writes a short decay protocol, changed as told."""

    def write(name: str = "protocol.yaml", **keys: object) -> Path:
        return write_short_decay(tmp_path / name, **keys)

    return write


SHORT_DECAY: dict[str, Any] = {
    "protocol": "decay",
    "sample": {"name": "test"},
    "charge": "15 min",
    "for": "60 s",
    "exposure": "1 s",
}


def write_short_decay(path: Path, **keys: object) -> Path:
    """Write a short decay protocol, changed as told."""
    path.write_text(write_quickly(SHORT_DECAY | keys), encoding="utf-8")
    return path


@pytest.fixture(scope="session")
def started_chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator["Chrome"]:
    """A real browser; it takes longer to start than most tests take with it."""
    from tests.chromium import IS_MISSING, browser

    if IS_MISSING:
        pytest.skip("needs chromium and chromedriver")
    with browser(tmp_path_factory.mktemp("chromium")) as chrome:
        yield chrome


@pytest.fixture
def chromium(started_chromium: "Chrome") -> Iterator["Chrome"]:
    """A new window of a real browser: what other tests emulate is not there."""
    from tests.chromium import new_window

    with new_window(started_chromium) as chrome:
        yield chrome
