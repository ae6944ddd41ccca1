"""Play a bag on time: schedule, read-ahead, keys."""
