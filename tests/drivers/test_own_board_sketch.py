"""The manual's sketch, compiled for this PC, and the emulated board do the same."""

import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given, settings, strategies as st

from labrig.foundation.clock import VirtualClock
from labrig.sim.boards import ArduinoBoard

PAGE = Path(__file__).parents[2] / "docs/how-to/own_board.md"
COMPILER = shutil.which("c++")
#: Enough of an Arduino; its standard input says what happens: `wait MS` or `bytes HEX`.
ARDUINO = r"""
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <deque>
enum { LOW, HIGH, OUTPUT };
static unsigned long now_ms = 0;
static std::deque<int> coming;
static int levels[32];
static unsigned long millis() { return now_ms; }
static void pinMode(int, int) {}
static void digitalWrite(int pin, int level) { levels[pin] = level; }
struct {
  void begin(long) {}
  int available() { return (int)coming.size(); }
  int read() { int byte = coming.front(); coming.pop_front(); return byte; }
  void println(const char* text) { printf("%s\r\n", text); }
} Serial;
"""
MAIN = r"""
int main() {
  char what[8], hex[4096];
  setup();
  while (scanf("%7s %4095s", what, hex) == 2) {
    if (strcmp(what, "wait") == 0) now_ms += strtoul(hex, nullptr, 10);
    else for (char* pair = hex; *pair; pair += 2) {
      char digits[3] = {pair[0], pair[1], 0};
      coming.push_back((int)strtoul(digits, nullptr, 16));
    }
    loop();
  }
  printf("relays");
  for (int pin : PINS) printf(" %d", levels[pin] == ON);
}
"""

Happening = int | bytes


@pytest.fixture(scope="module")
def sketch(tmp_path_factory: pytest.TempPathFactory) -> Callable[[list[Happening]], bytes]:
    """Runs the sketch; returns its answers and the final states of its relays."""
    if COMPILER is None:
        pytest.skip("no C++ compiler on this PC")
    (text,) = re.findall(r"^```cpp\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.M | re.S)
    folder = tmp_path_factory.mktemp("sketch")
    (folder / "sketch.cpp").write_text(ARDUINO + text + MAIN, encoding="utf-8")
    command = [COMPILER, "-Wall", "-Wextra", "-Werror", "-o", "sketch", "sketch.cpp"]
    subprocess.run(command, cwd=folder, check=True)

    def run(happenings: list[Happening]) -> bytes:
        lines = [
            f"wait {what * 1000}" if isinstance(what, int) else f"bytes {what.hex()}"
            for what in happenings
        ]
        return subprocess.run(
            [folder / "sketch"], input="\n".join(lines).encode(), capture_output=True, check=True
        ).stdout

    return run


def emulated(happenings: list[Happening]) -> bytes:
    clock = VirtualClock()
    board = ArduinoBoard(4, lambda relay, on: None, clock)
    answers = b""
    for what in happenings:
        if isinstance(what, int):
            clock.sleep(what)
        else:
            answers += board.receive(what)
    board.receive(b"\r")  # a byte on which the emulated one looks at its watchdog
    states = " ".join(str(int(state)) for state in board.states)
    return answers + f"relays {states}".encode()


COMMANDS = [
    *(b"on 0\n", b"off 0\n", b"state 0\n", b"on 3\r\n", b"state 3\n", b"off 3\n"),
    *(b"alive\n", b"version\n", b"\n"),
    *(b"on 4\n", b"on 00\n", b"alive now and for ever and ever, amen\n"),
]
#: Waits in seconds whose sums stay away from the watchdog's 180 s.
WAITS = [1, 50, 200]


@settings(max_examples=30)
@given(
    st.lists(
        st.sampled_from(COMMANDS) | st.sampled_from(WAITS) | st.binary(min_size=1, max_size=5),
        max_size=10,
    )
)
def test_the_emulated_board_is_the_sketch(
    sketch: Callable[[list[Happening]], bytes], happenings: list[Happening]
) -> None:
    assert sketch(happenings) == emulated(happenings)


def test_silence_switches_off(sketch: Callable[[list[Happening]], bytes]) -> None:
    lit: list[Happening] = [b"on 2\n", 179, b"alive\n"]
    assert sketch(lit).split() == [b"ok", b"ok", b"relays", b"0", b"0", b"1", b"0"]
    assert sketch([*lit, 181]).split() == [b"ok", b"ok", b"relays", b"0", b"0", b"0", b"0"]
