"""What a recording tells its surroundings: the parent process, or people at a terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.console import Console

from slip_msgs_py.events import Ready, Status, emit, warn

if TYPE_CHECKING:
    from slip_bags.recording.recorder import Recorder


class Listener:
    """Tells the parent process."""

    def ready(self) -> None:
        """Every topic asked for by name has a publisher."""
        emit(Ready())

    def warning(self, text: str) -> None:
        """Something is not recorded as wished."""
        warn("recorder", text)

    def status(self, recorder: Recorder, elapsed_s: float) -> None:
        """Called after every flush."""
        emit(Status(*recorder.totals()))


class TerminalListener(Listener):
    """Shows a running recording on a terminal, and warnings anywhere."""

    def __init__(self) -> None:
        self._console = Console(stderr=True)

    def ready(self) -> None:
        """Say so."""
        self._console.print("recording; Ctrl-C ends")

    def status(self, recorder: Recorder, elapsed_s: float) -> None:
        """Redraw the line."""
        if not self._console.is_terminal:
            return
        messages, lost = recorder.totals()
        line = f"{elapsed_s:8.1f} s  {messages} messages  {lost} lost"
        self._console.file.write(f"\r{line}\x1b[K")
        self._console.file.flush()
