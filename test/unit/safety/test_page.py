"""The safety page has the modes of the code."""

from __future__ import annotations

from pathlib import Path

from slip_vic_controller.safety.modes import Mode

PAGE = (Path(__file__).parents[3] / "docs" / "safety.md").read_text(encoding="utf-8")


def test_every_mode_has_its_row() -> None:
    for mode in Mode:
        assert f"| {mode.name} |" in PAGE
