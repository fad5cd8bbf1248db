"""Server of the page of `labrig design`, for browsers on this PC only."""

import threading
from collections.abc import Callable, Mapping
from http import HTTPStatus
from pathlib import Path
from typing import Any, ClassVar, Never

from labrig.clock import Clock
from labrig.design import WishFile
from labrig.errors import UsageError
from labrig.local_server import LocalConversation, LocalServer
from labrig.studio.scene_bench import SceneBench
from labrig.studio.workbench import Workbench
from labrig.yaml_file import read_model

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
            "studio_document.js",
            "studio_key_list.js",
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


#: What only a page about a scene asks for.
SCENE_PATHS = ("scene.png", "seen", "again", "texture.npz")


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
        #: One design at a time: each takes all processors.
        self.turn = threading.Lock()
        super().__init__(port, _Conversation)


class _Conversation(LocalConversation):
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
        self.send_json(HTTPStatus.OK, {"wish": self.server.first})

    def accept(self, path: str, body: bytes) -> None:
        """Answer a question of the page."""
        bench, content = self.server.workbench, self.json_object(body)
        with self.server.turn:
            if path == "look":
                self.send_json(HTTPStatus.OK, bench.look(content))
            elif path == "open":
                self.send_json(HTTPStatus.OK, {"wish": bench.open(_text(content))})
            elif isinstance(bench, SceneBench) and path in SCENE_PATHS:
                self._answer_of_scene(bench, path, content)
            elif path == "nearest":
                self.send_json(HTTPStatus.OK, {"nearest": bench.nearest(content)})
            elif path == "material.yaml":
                self.send(HTTPStatus.OK, "application/yaml", bench.material(content).encode())
            elif path == "constraints.yaml":
                self.send(HTTPStatus.OK, "application/yaml", bench.constraints(content).encode())
            elif path == "picture.png":
                self.send(HTTPStatus.OK, "image/png", bench.picture(content))
            else:
                self.refuse(HTTPStatus.NOT_FOUND, "no such thing here")

    def _answer_of_scene(self, bench: SceneBench, path: str, content: Mapping[str, Any]) -> None:
        if path == "scene.png":
            picture = bench.picture_of_scene(content)
            more = {"X-Exposure": repr(picture.exposure)}
            self.send(HTTPStatus.OK, "image/png", picture.png, more)
        elif path == "seen":
            self.send_json(HTTPStatus.OK, {"rgb": bench.seen(content)})
        elif path == "texture.npz":
            self.send(HTTPStatus.OK, "application/octet-stream", bench.texture(content))
        else:
            self.send_json(HTTPStatus.OK, bench.again(content))


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
    >>> from labrig.clock import Interrupted, SystemClock
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
    wished = None if start is None else read_model(start, WishFile)
    if wished is not None and wished.scene is not None:
        scene, material = scene or wished.scene.file, material or wished.scene.material
    folder = Path() if start is None else start.parent
    workbench = Workbench() if scene is None else SceneBench(scene, material, folder)
    first = workbench.start() if wished is None else workbench.take(wished, str(start))
    with StudioServer(workbench, first, port) as server, server.running():
        tell(server.url)
        while True:
            clock.sleep(CHECK_PERIOD_S)
