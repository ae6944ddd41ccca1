"""Single keys from the terminal while something runs, and the line that shows it."""

from __future__ import annotations

import contextlib
import os
import select
import termios
import time
import tty
from collections.abc import Callable, Iterator
from typing import Final, TextIO

from slip_bags.playing.player import RATE_STEP, Controls, Player

_POLL_S: Final = 0.02
_DRAW_S: Final = 0.2
_WIDTH: Final = 30
_ARROWS: Final = {
    "\x1b[A": "up",
    "\x1b[B": "down",
    "\x1b[C": "step",
    "\x1bOA": "up",
    "\x1bOB": "down",
    "\x1bOC": "step",
}
_KEYS: Final = {" ": "pause", "s": "step", "q": "quit", "+": "up", "-": "down"}


@contextlib.contextmanager
def raw_keys(stream: TextIO) -> Iterator[int | None]:
    """Give the file descriptor of a terminal that delivers single keys; None where `stream` is no terminal."""
    if not stream.isatty():
        yield None
        return
    descriptor = stream.fileno()
    before = termios.tcgetattr(descriptor)
    try:
        tty.setcbreak(descriptor)
        yield descriptor
    finally:
        termios.tcsetattr(descriptor, termios.TCSADRAIN, before)


class TerminalControls(Controls):
    """Keys in, one line of progress out; neither may take longer than the messages' spacing allows.

    Args:
        keys: descriptor of the terminal, None without one.
        screen: where the line goes, None without a terminal.
        stop: asked whether a signal has come.
    """

    def __init__(self, keys: int | None, screen: TextIO | None, stop: Callable[[], bool]) -> None:
        self._keys, self._screen, self._stop = keys, screen, stop
        self._next_poll = self._next_draw = 0.0
        self._bag_time_ns: int | None = None

    def poll(self, player: Player) -> None:
        """Answer signals, keys and redraw, each at its own low rate."""
        if self._stop():
            player.stopping = True
        now = time.monotonic()
        if now < self._next_poll:
            return
        self._next_poll = now + _POLL_S
        if self._keys is not None:
            for key in self._pressed():
                self._act(player, key)
        if now >= self._next_draw:
            self._next_draw = now + _DRAW_S
            self._draw(player)

    def progress(self, player: Player, bag_time_ns: int) -> None:
        """Remember the time that is drawn next."""
        self._bag_time_ns = bag_time_ns

    def finish(self, player: Player) -> None:
        """Draw a last time and leave the line."""
        self._draw(player)
        if self._screen is not None:
            self._screen.write("\n")
            self._screen.flush()

    def _pressed(self) -> list[str]:
        assert self._keys is not None
        if not select.select([self._keys], [], [], 0.0)[0]:
            return []
        text = os.read(self._keys, 64).decode("utf-8", "replace")
        found = []
        while text:
            arrow = next((code for code in _ARROWS if text.startswith(code)), None)
            found.append(_ARROWS[arrow] if arrow else _KEYS.get(text[0], ""))
            text = text[len(arrow) if arrow else 1 :]
        return found

    @staticmethod
    def _act(player: Player, key: str) -> None:
        schedule = player.schedule
        if key == "pause":
            schedule.resume() if schedule.paused else schedule.pause()
        elif key == "step":
            schedule.pause()
            player.steps += 1
        elif key in ("up", "down"):
            schedule.set_rate(schedule.rate * (RATE_STEP if key == "up" else 1.0 / RATE_STEP))
        elif key == "quit":
            player.stopping = True

    def _draw(self, player: Player) -> None:
        if self._screen is None:
            return
        now = player.start_ns if self._bag_time_ns is None else self._bag_time_ns
        total = max(player.end_ns - player.start_ns, 1)
        filled = round(_WIDTH * (now - player.start_ns) / total)
        state = "paused" if player.schedule.paused else f"x {player.schedule.rate:.2f}"
        seconds = f"{(now - player.start_ns) * 1e-9:8.3f}/{total * 1e-9:.3f} s"
        self._screen.write(
            f"\r[{'#' * filled}{'.' * (_WIDTH - filled)}] {seconds}  {player.played} messages  {state}\x1b[K"
        )
        self._screen.flush()
