"""Network namespaces and a cable between two of them, for tests over an interface that is not localhost."""

from __future__ import annotations

import contextlib
import os
import shutil
import subprocess
import time
from collections.abc import Sequence
from typing import Any

_NEAR, _FAR = "svcable", "svplant"
_START_S = 5.0


def own_network() -> list[str]:
    """Return the words that run a command in a network namespace of its own, none where that is not permitted."""
    words = ["unshare", *([] if os.geteuid() == 0 else ["--user", "--map-root-user"]), "--net", "--"]
    tools = all(shutil.which(tool) for tool in ("unshare", "nsenter", "ip"))
    return words if tools and _quietly([*words, "ip", "link", "set", "lo", "up"]) else []


class Cable:
    """A second namespace and a cable to it; a context manager. Both exist before DDS looks for its interfaces."""

    def __enter__(self) -> Cable:
        self._holder = subprocess.Popen(["unshare", "--net", "sleep", "infinity"], start_new_session=True)
        own = os.readlink("/proc/self/ns/net")
        end = time.monotonic() + _START_S
        while self._namespace() in ("", own) and time.monotonic() < end:
            time.sleep(0.01)
        for words in (
            "link set lo up",
            f"link add {_NEAR} type veth peer name {_FAR} netns {self._holder.pid}",
            f"addr add 10.93.0.1/24 dev {_NEAR}",
            f"link set {_NEAR} up",
        ):
            _run(["ip", *words.split()])
        for words in ("link set lo up", f"addr add 10.93.0.2/24 dev {_FAR}", f"link set {_FAR} up"):
            _run(self.behind(["ip", *words.split()]))
        # DDS looks for its interfaces once, and one without a carrier is none.
        while not self._is_up() and time.monotonic() < end:
            time.sleep(0.01)
        return self

    def __exit__(self, *_: object) -> None:
        self._holder.kill()
        self._holder.wait()

    def _is_up(self) -> bool:
        words = self.behind(["ip", "link", "show", _FAR])
        return " state UP " in subprocess.run(words, check=True, capture_output=True, text=True).stdout

    def _namespace(self) -> str:
        with contextlib.suppress(OSError):
            return os.readlink(f"/proc/{self._holder.pid}/ns/net")
        return ""

    def behind(self, argv: Sequence[str]) -> list[str]:
        """Return the command that runs behind the cable."""
        return ["nsenter", "--target", str(self._holder.pid), "--net", "--", *argv]


def _run(argv: Sequence[str]) -> None:
    subprocess.run(list(argv), check=True, stdin=subprocess.DEVNULL)


def _quietly(argv: Sequence[str]) -> bool:
    nothing: Any = subprocess.DEVNULL
    return subprocess.run(list(argv), stdin=nothing, stdout=nothing, stderr=nothing, check=False).returncode == 0
