"""Record topics of a running system: subscriptions, loss counters, the recorder and who it tells."""

from typing import Final

QUEUE_DEPTH: Final = 10_000
"""Messages per topic that wait for the recorder: 4 s of a run at full speed."""
