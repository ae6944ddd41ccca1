"""A server with few files left outlives more idle connections than it can hold."""

from __future__ import annotations

import contextlib
import socket
import subprocess
import sys
import time
import urllib.request

SERVE = """
import resource, time
resource.setrlimit(resource.RLIMIT_NOFILE, (256, 256))
from slip_vic.page.audience import Audience
audience = Audience(0)
print(audience.port, flush=True)
while True:
    time.sleep(0.05)
"""

UPGRADE = (
    b"GET /live HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    b"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
)


def test_idle_connections_do_not_end_the_server() -> None:
    with subprocess.Popen([sys.executable, "-c", SERVE], stdout=subprocess.PIPE, text=True) as child:
        try:
            assert child.stdout is not None
            port = int(child.stdout.readline())
            with contextlib.ExitStack() as idle:
                for number in range(300):  # the kernel holds back what is beyond them
                    one = idle.enter_context(socket.create_connection(("127.0.0.1", port)))
                    if number % 2:
                        with contextlib.suppress(OSError):
                            one.sendall(UPGRADE)
            end = time.monotonic() + 20.0
            while not is_answered(port) and time.monotonic() < end:
                time.sleep(0.1)
            assert is_answered(port)
            assert child.poll() is None
        finally:
            child.kill()


def is_answered(port: int) -> bool:
    """Return whether the page comes."""
    with contextlib.suppress(OSError), urllib.request.urlopen(f"http://127.0.0.1:{port}/", timeout=5.0) as response:
        return int(response.status) == 200
    return False
