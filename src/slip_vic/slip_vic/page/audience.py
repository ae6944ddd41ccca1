"""The browsers that watch a run: a server of the page, and a thread for each that sends it the model, then numbers."""

from __future__ import annotations

import contextlib
import http
import json
import queue
import re
import socket
import threading
from typing import Any, Final

from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response
from websockets.sync.server import Server, ServerConnection, serve

from slip_core.errors import InputError, SlipVicError
from slip_vic.page.page import assemble

QUEUED: Final = 50
"""Frames that may wait for a slow browser; then it gets the next newest ones."""
CLIENTS: Final = 32
"""Connections at a time; further ones are closed at once."""
MODEL: Final = "model"
"""Tells a browser that the next message is a model, not a frame."""


class Audience:
    """The browsers: serves the page, sends each the model and then frames."""

    def __init__(self, host: str, port: int) -> None:
        self._page = assemble(
            live=True, title="slip-vic watch", table="", laws="", facts="", notes="", data="", description=""
        ).encode()
        self._model = b""
        self._newest = b""
        self._ended = ""
        self._queues: dict[queue.Queue[bytes | str], ServerConnection] = {}
        self._lock = threading.Lock()
        self._over = False
        names = "|".join(map(re.escape, ("localhost", host, socket.gethostname())))
        self._hosts = re.compile(rf"(?i:{names}|[\d.]+|\[[\da-f:]+\])(:\d+)?")
        try:
            self._server: Server = serve(
                self._attend, host, port, process_request=self._answer, compression=None,
                create_connection=self._connect,  # type: ignore[arg-type]
            )  # fmt: skip
        except OSError as error:
            raise InputError(
                f"address {host}:{port}", got=error, expected="a free port", fix="choose another --port"
            ) from None
        self.port = int(self._server.socket.getsockname()[1])
        self._thread = threading.Thread(target=self._server.serve_forever, name="watch-server", daemon=True)
        self._thread.start()

    @property
    def present(self) -> bool:
        """Whether a browser is connected."""
        return bool(self._queues)

    def check(self) -> None:
        """Raise SlipVicError where the page is served no more."""
        if not self._thread.is_alive():
            raise SlipVicError("watch: the server of the page has ended, for instance without a free file descriptor")

    def begin(self, model: bytes) -> None:
        """Take another model and send it."""
        with self._lock:
            self._model, self._newest, self._ended = model, b"", ""
            for waiting in self._queues:
                waiting.put(model)

    def send(self, data: bytes) -> None:
        """Send a frame to every browser; a slow one misses some."""
        with self._lock:
            self._newest = data
            for waiting in self._queues:
                if waiting.qsize() < QUEUED:
                    waiting.put(data)

    def mode(self, arm: int, text: str) -> None:
        """Send the mode of an arm with its reason, which no frame holds."""
        self._say({"arm": arm, "mode": text})

    def ended(self, why: str) -> None:
        """Send why nothing arrives, "" where something does; a browser that comes later gets it too."""
        self._ended = why
        self._say({"ended": why})

    def _say(self, message: dict[str, Any]) -> None:
        with self._lock:
            for waiting in self._queues:
                waiting.put(json.dumps(message))

    def close(self) -> None:
        """Let go of every browser at once, one that is slow would be waited for, and stop serving."""
        with self._lock:
            self._over = True
            for waiting, connection in self._queues.items():
                waiting.put(b"")
                with contextlib.suppress(OSError):
                    connection.socket.shutdown(socket.SHUT_RDWR)
        self._server.shutdown()

    def _connect(self, *arguments: Any, **options: Any) -> ServerConnection:
        if len(self._server.handler_threads) > CLIENTS:
            raise ConnectionRefusedError
        return ServerConnection(*arguments, **options)

    def _is_own(self, headers: Headers) -> bool:
        """Whether the page asks that is served here, not one of another origin or under another name."""
        hosts, origins = headers.get_all("Host"), headers.get_all("Origin")
        return len(hosts) == 1 and bool(self._hosts.fullmatch(hosts[0])) and set(origins) <= {f"http://{hosts[0]}"}

    def _answer(self, _: ServerConnection, request: Request) -> Response | None:
        if not self._is_own(request.headers):
            status, text = http.HTTPStatus.FORBIDDEN, b""
        elif request.path == "/live":
            return None
        else:
            status, text = (http.HTTPStatus.OK, self._page) if request.path == "/" else (http.HTTPStatus.NOT_FOUND, b"")
        kind = {"Content-Type": "text/html; charset=utf-8", "Content-Length": str(len(text)), "Connection": "close"}
        return Response(status.value, status.phrase, Headers(kind), text)

    def _attend(self, connection: ServerConnection) -> None:
        waiting: queue.Queue[bytes | str] = queue.Queue()
        with self._lock:
            if self._over:
                return
            if self._model:
                for message in (self._model, self._newest, self._ended and json.dumps({"ended": self._ended})):
                    if message:
                        waiting.put(message)
            self._queues[waiting] = connection
        try:
            with contextlib.suppress(ConnectionClosed):
                while data := waiting.get():
                    if data is self._model:
                        connection.send(MODEL)
                    connection.send(data)
        finally:
            with self._lock:
                del self._queues[waiting]
