"""Hands in the simulated room, told what to do line by line."""

from collections.abc import Callable, Mapping


class HandsBoard:
    """Answers `done`, or `cannot …`, to every line.

    Parameters
    ----------
    tasks
        What the hands can do, by the line that tells them.
    """

    def __init__(self, tasks: Mapping[str, Callable[[], None]]) -> None:
        self._tasks = dict(tasks)
        self._line = b""

    def receive(self, data: bytes) -> bytes:
        """What they answer, in order, for these bytes."""
        answer = b""
        for byte in data:
            if byte != ord("\n"):
                self._line += bytes((byte,))
                continue
            line, self._line = self._line.decode("utf-8", errors="replace"), b""
            if line:
                answer += self._do(line).encode()
        return answer

    def _do(self, task: str) -> str:
        if task not in self._tasks:
            return f"cannot {task}; known: {', '.join(self._tasks)}\n"
        self._tasks[task]()
        return "done\n"
