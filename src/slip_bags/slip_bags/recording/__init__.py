"""Record topics of a running system: subscriptions, loss counters, the recorder and who it tells."""
