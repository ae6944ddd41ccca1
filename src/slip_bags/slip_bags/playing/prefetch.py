"""Read ahead in a thread, so that opening a chunk does not delay the message that is due."""

from __future__ import annotations

import queue
import threading
from collections.abc import Iterable, Iterator
from typing import Final, Generic, TypeVar

Item = TypeVar("Item")
DEPTH: Final = 5000
_END: Final = object()


class Prefetch(Generic[Item]):
    """Iterates over `items`, produced by a thread up to `DEPTH` ahead; close it where it is not used up."""

    def __init__(self, items: Iterable[Item]) -> None:
        self._items = items
        self._queue: queue.Queue[object] = queue.Queue(DEPTH)
        self._stopping = threading.Event()
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._produce, name="bag-read-ahead", daemon=True)
        self._thread.start()

    def __iter__(self) -> Iterator[Item]:
        while (item := self._queue.get()) is not _END:
            yield item  # type: ignore[misc]
        if self._error is not None:
            raise self._error

    def close(self) -> None:
        """Stop the thread."""
        self._stopping.set()
        while self._thread.is_alive():
            try:
                self._queue.get(timeout=0.01)
            except queue.Empty:
                continue

    def _produce(self) -> None:
        try:
            for item in self._items:
                if self._stopping.is_set():
                    return
                self._queue.put(item)
        except BaseException as error:  # handed over to the consumer
            self._error = error
        finally:
            self._queue.put(_END)
