"""The changer of the simulated room, instructed line by line."""

from collections.abc import Callable, Mapping

from labrig.foundation.errors import UsageError


class ChangerBoard:
    """Board that answers `done`, or `cannot …`, to every line.

    Parameters
    ----------
    tasks
        Tasks of the changer by their command line. A task such as `filter NAME` receives the text
        in place of the word in capitals; it raises UsageError where it is impossible.
    """

    def __init__(self, tasks: Mapping[str, Callable[..., None]]) -> None:
        self._tasks = dict(tasks)
        self._line = b""

    def receive(self, data: bytes) -> bytes:
        """Return the changer's answers to these bytes, in order."""
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
        try:
            self.do(task)
        except UsageError as error:
            return f"cannot {task}; {error}\n"
        return "done\n"

    def do(self, task: str) -> None:
        """Do the task of one line.

        Raises
        ------
        UsageError
            The changer does not know the task.
        """
        for pattern, act in self._tasks.items():
            words, _, variable = pattern.rpartition(" ")
            if task == pattern:
                act()
                return
            if variable.isupper() and task.startswith(f"{words} "):
                act(task.removeprefix(f"{words} "))
                return
        raise UsageError(f"known: {', '.join(self._tasks)}")
