"""Server of the page of `labrig design`, for browsers on this PC only."""

import json
import threading
from collections.abc import Callable, Mapping
from http import HTTPStatus
from pathlib import Path
from typing import Any, ClassVar, Never

from labrig.design import WishFile
from labrig.foundation.clock import Clock
from labrig.foundation.errors import UsageError
from labrig.foundation.file_kind import WISH, require_kind
from labrig.foundation.named_files import beside
from labrig.foundation.signals import interrupting
from labrig.foundation.yaml_file import read_model
from labrig.local_server import LocalServer, RequestHandler
from labrig.studio.scene_bench import SceneBench
from labrig.studio.workbench import Workbench

#: Longest real time until Ctrl-C is answered.
CHECK_PERIOD_S = 0.2
_HERE = Path(__file__).parent

PAGES: Mapping[str, Path] = {
    "": _HERE / "studio_page.html",
    **{
        name: _HERE / name
        for name in (
            "studio_page.css",
            "studio_page.js",
            "studio_colour.js",
            "studio_history.js",
            "studio_key_panel.js",
            "studio_keys.js",
            "studio_light.js",
            "studio_material.js",
            "studio_patches.js",
            "studio_scene.js",
            "studio_spread.js",
            "studio_timeline.js",
            "studio_words.js",
        )
    },
}


class StudioServer(LocalServer):
    """Server of the page.

    Parameters
    ----------
    workbench
        What answers the page.
    first
        Wish with which the page begins.
    port
        TCP port on 127.0.0.1; 0 for any that is free.

    Raises
    ------
    UsageError
        The port is taken.
    """

    def __init__(self, workbench: Workbench, first: Mapping[str, Any], port: int = 0) -> None:
        self.workbench = workbench
        self.first = first
        #: One design and one picture at a time: both may be asked for while a hand drags.
        self.turns = {is_picture: threading.Lock() for is_picture in (False, True)}
        super().__init__(port, _Conversation)


class _Conversation(RequestHandler):
    """A connection of a browser."""

    server: StudioServer
    pages: ClassVar[Mapping[str, Path]] = PAGES
    #: A thousand keys fit.
    max_body_bytes: ClassVar[int] = 4 * 1024 * 1024

    def answer(self, path: str) -> None:
        """Send what the page begins with."""
        if path != "start":
            super().answer(path)
            return
        self.send_json(
            HTTPStatus.OK,
            {"wish": self.server.first, "presets": self.server.workbench.preset_names()},
        )

    def accept(self, path: str, body: bytes) -> None:
        """Answer a question of the page."""
        bench, content = self.server.workbench, self.json_object(body)
        with self.server.turns[path == "scene.png"]:
            kind, data, more = _answer(bench, path, content)
        if data is None:
            self.refuse(HTTPStatus.NOT_FOUND, "no such thing here")
        else:
            self.send(HTTPStatus.OK, kind, data, more)


def _answer(
    bench: Workbench, path: str, content: Mapping[str, Any]
) -> tuple[str, bytes | None, Mapping[str, str]]:
    """Return kind, data and headers of an answer to the page; no data of what nobody knows."""
    if isinstance(bench, SceneBench):
        if path == "scene.png":
            picture = bench.picture_of_scene(content)
            return "image/png", picture.png, {"X-Exposure": repr(picture.exposure)}
        if path == "seen":
            return _as_json({"rgb": bench.seen(content)})
        if path == "texture.npz":
            return "application/octet-stream", bench.texture(content), {}
        if path == "again":
            return _as_json(bench.again(content))
    if path == "look":
        return _as_json(bench.look(content))
    if path == "open":
        return _as_json({"wish": bench.open(_text(content))})
    if path == "preset":
        return _as_json({"parameters": bench.preset(content)})
    if path == "nearest":
        return _as_json({"nearest": bench.nearest(content)})
    if path == "material.yaml":
        return "application/yaml", bench.material(content).encode(), {}
    if path == "constraints.yaml":
        return "application/yaml", bench.constraints(content).encode(), {}
    if path == "picture.png":
        return "image/png", bench.picture(content), {}
    return "", None, {}


def _as_json(content: Mapping[str, Any]) -> tuple[str, bytes, Mapping[str, str]]:
    return "application/json", json.dumps(content).encode(), {}


def _text(content: Mapping[str, Any]) -> str:
    text = content.get("text")
    if not isinstance(text, str):
        raise UsageError("expected the text of a file")
    return text


def design_on_page(
    start: Path | None,
    scene: str | None,
    material: str | None,
    port: int,
    clock: Clock,
    tell: Callable[[str], None],
) -> Never:
    """Serve the page on which a material is designed, until it is interrupted.

    Parameters
    ----------
    start
        File of wishes with which the page begins; None for light and no wish.
    scene
        Scene file, or the name of a shipped scene; None for a patch under five minutes of daylight.
    material
        Name of the material of the scene that is designed; None for the only one that glows.
    port
        TCP port on 127.0.0.1; 0 for any that is free.
    clock
        Clock of the PC; its waits are where an interruption is answered.
    tell
        Function that is called once, with the address of the page.

    Raises
    ------
    Interrupted
        On Ctrl-C.
    UsageError
        A file is malformed, the scene moves or has no such material, or the port is taken.

    Examples
    --------
    >>> import signal
    >>> from labrig.foundation.clock import Interrupted, SystemClock
    >>> from labrig.studio import design_on_page
    >>> clock = SystemClock()
    >>> def tell(url):
    ...     print(url.partition(":")[0])
    ...     clock.interrupt(signal.SIGINT)  # Ctrl-C, as soon as the page is served
    >>> try:
    ...     design_on_page(None, None, None, 0, clock, tell)
    ... except Interrupted:
    ...     print("stopped")
    http
    stopped
    """
    if start is not None:
        require_kind(start, WISH)
    wished = None if start is None else read_model(start, WishFile)
    if wished is not None and wished.scene is not None:
        named = wished.scene.file
        in_place = beside(named, start.parent) if start else named
        scene, material = scene or in_place, material or wished.scene.material
    folder = Path() if start is None else start.parent
    workbench = Workbench() if scene is None else SceneBench(scene, material, folder)
    first = workbench.start() if wished is None else workbench.take(wished, str(start))
    with interrupting(clock), StudioServer(workbench, first, port) as server, server.running():
        tell(server.url)
        while True:
            clock.sleep(CHECK_PERIOD_S)
