"""Tests, referees and campaigns."""
