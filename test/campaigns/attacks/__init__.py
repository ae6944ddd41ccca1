"""Attack suite: what an attacker on the same network can do to the running nodes."""
