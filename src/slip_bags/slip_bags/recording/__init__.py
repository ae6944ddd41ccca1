"""Record topics of a running system: raw subscriptions, loss counters, and the recorder."""
