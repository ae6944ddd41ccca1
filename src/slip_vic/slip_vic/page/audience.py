"""The browsers that watch a run: a server of the page, in a thread, that sends each the model, then numbers."""

from __future__ import annotations

import asyncio
import http
import json
import re
import threading
from concurrent.futures import Future
from typing import Final

from websockets.asyncio.server import ServerConnection, broadcast, serve
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from slip_core.errors import InputError
from slip_vic.page.page import assemble

MODEL: Final = "model"
"""Tells a browser that the next message is a model, not a frame."""
HOST: Final = "127.0.0.1"
OWN: Final = re.compile(r"(localhost|127\.0\.0\.1)(:\d+)?")
"""Host names used by a browser on this machine."""
MOST: Final = 16
"""Connections that are served at once, and that wait to be: two browsers take four."""


class Connection(ServerConnection):
    """A connection of a browser, ended at once where too many are there already, whatever they ask for."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Begin to serve it."""
        super().connection_made(transport)
        if len(self.server.handler_tasks) > MOST:
            self.transport.abort()


class Audience:
    """The browsers: serves the page, sends each the model and then frames; a slow one misses some."""

    def __init__(self, port: int) -> None:
        self._page = assemble(
            live=True, title="slip-vic watch", table="", laws="", facts="", notes="", data="", description=""
        ).encode()
        self._kept: dict[str, bytes | str] = {}
        self._browsers: set[ServerConnection] = set()
        started: Future[int] = Future()
        serving = self._serve(port, started)
        self._thread = threading.Thread(target=asyncio.run, args=(serving,), name="watch-server", daemon=True)
        self._thread.start()
        try:
            self.port = started.result()
        except OSError as error:
            raise InputError(f"--port {port}", got=error, expected="a free port", fix="choose another") from None

    async def _serve(self, port: int, started: Future[int]) -> None:
        self._loop, self._over = asyncio.get_running_loop(), asyncio.Event()
        try:
            server = await serve(
                self._attend, HOST, port, process_request=self._answer, compression=None, ping_interval=None,
                create_connection=Connection, backlog=MOST,
            )  # fmt: skip
        except OSError as error:
            started.set_exception(error)
            return
        started.set_result(int(next(iter(server.sockets)).getsockname()[1]))
        await self._over.wait()  # the end of the loop lets go of every browser at once

    @property
    def present(self) -> bool:
        """Whether a browser is connected."""
        return bool(self._browsers)

    def begin(self, model: bytes) -> None:
        """Take another model and send it."""
        self._loop.call_soon_threadsafe(self._kept.clear)
        self._say(MODEL, "what comes")
        self._say(model, "model")

    def send(self, data: bytes) -> None:
        """Send a frame to every browser that has got what was sent before."""
        self._say(data, "frame", late=False)

    def tell(self, keep: str = "", **what: object) -> None:
        """Send what no frame holds: the mode of an arm, or why nothing arrives; keep: what it replaces."""
        self._say(json.dumps(what), keep)

    def close(self) -> None:
        """Stop serving."""
        self._loop.call_soon_threadsafe(self._over.set)
        self._thread.join()

    def _say(self, message: bytes | str, keep: str = "", *, late: bool = True) -> None:
        """Send a message to every browser.

        keep: what it replaces for a browser that comes later; late: also to one that is behind.
        """

        def say() -> None:
            if keep:
                self._kept[keep] = message
            behind = {one for one in self._browsers if not late and one.transport.get_write_buffer_size()}
            broadcast(self._browsers - behind, message)

        self._loop.call_soon_threadsafe(say)

    def _answer(self, _: ServerConnection, request: Request) -> Response | None:
        """Answer the page that is served here, not one of another origin or under another name."""
        hosts, origins = request.headers.get_all("Host"), request.headers.get_all("Origin")
        status = http.HTTPStatus.OK if request.path in ("/", "/live") else http.HTTPStatus.NOT_FOUND
        if len(hosts) != 1 or not OWN.fullmatch(hosts[0]) or not set(origins) <= {f"http://{hosts[0]}"}:
            status = http.HTTPStatus.FORBIDDEN
        elif request.path == "/live":
            return None
        text = self._page if status == http.HTTPStatus.OK else b""
        kind = {"Content-Type": "text/html; charset=utf-8", "Content-Length": str(len(text)), "Connection": "close"}
        return Response(status.value, status.phrase, Headers(kind), text)

    async def _attend(self, connection: ServerConnection) -> None:
        for message in self._kept.values():
            broadcast([connection], message)
        self._browsers.add(connection)
        try:
            await connection.wait_closed()
        finally:
            self._browsers.discard(connection)
