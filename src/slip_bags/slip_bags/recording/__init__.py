"""Record topics of a running system: raw subscriptions, loss counters, and the recorder."""

from typing import Final

QUEUE_DEPTH: Final = 10_000
"""Messages per topic that wait for the recorder: 10 s at 1 kHz."""
