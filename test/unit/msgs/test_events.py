"""The events of a child process: one spelling for both sides, and lines that are something else stay lines."""

from __future__ import annotations

import pytest

from slip_msgs_py import environment
from slip_msgs_py.environment import decode, emit, warn
from slip_vic.run.launcher import Launcher
from slip_vic.scenarios.scenario import load


def test_events_survive_the_way_through_their_lines(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv(environment.EVENTS_VARIABLE, "1")
    emit("warning", text='core 7 is not available ("7")\n')
    emit("done", ticks=3, topics={"/a": {"lost": None}})
    assert [decode(line) for line in capsys.readouterr().out.splitlines()] == [
        ("warning", {"text": 'core 7 is not available ("7")\n'}),
        ("done", {"ticks": 3, "topics": {"/a": {"lost": None}}}),
    ]


@pytest.mark.parametrize(
    "line",
    ["", "error: a line for people", '{"event": "unheard of"}', '{"event": ["list"]}', '{"event"', '{"other": 1}'],
)
def test_other_lines_are_no_events(line: str) -> None:
    assert decode(line) is None


def test_warnings_of_recorder_and_set_up_reach_the_result(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """What the children print is what the launcher reads."""
    monkeypatch.setenv(environment.EVENTS_VARIABLE, "1")
    warn("recorder", "topic /x has several types")
    warn("slip_sim_bridge.node", "core 7 is not available")
    launcher = Launcher(load("paper_planar", law="vic"))
    for line in capsys.readouterr().out.splitlines():
        event = decode(line)
        assert event is not None, line
        launcher.note("recorder", event)
    assert launcher.warnings == ["recorder: topic /x has several types", "recorder: core 7 is not available"]


def test_without_a_parent_only_warnings_are_told(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv(environment.EVENTS_VARIABLE, raising=False)
    emit("done")
    warn("recorder", "topic /x has several types")
    told = capsys.readouterr()
    assert (told.out, told.err) == ("", "warning: recorder: topic /x has several types\n")
