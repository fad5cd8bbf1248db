"""When whoever read what a command prints has gone."""

import os
from typing import TextIO


def say_no_more(stream: TextIO) -> None:
    """What is still written to `stream` is dropped."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
