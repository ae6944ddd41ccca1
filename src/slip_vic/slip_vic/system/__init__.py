"""The system that a command starts: processes, domains, shared memory."""
