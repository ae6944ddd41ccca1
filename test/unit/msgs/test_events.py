"""The events of a child process: one spelling for both sides, and lines that are something else stay lines."""

from __future__ import annotations

import pytest

from slip_core.incidents import Incident
from slip_msgs_py import events
from slip_msgs_py.events import Done, Failed, Progress, Ready, Started, Status, Warned, decode, emit, encode, warn
from slip_vic.run.launcher import Launcher
from slip_vic.scenarios.scenario import load_scenario

EVENTS = (
    Started(),
    Ready(),
    Progress(0.25, 250),
    Status(12, 1),
    Incident("lost", 1.25, "the object is lost: the grip is zero"),
    Warned('core 7 is not available ("7")'),
    Failed("File too large"),
    Done({"ticks": 3, "topics": {"/a": {"lost": None}}}),
)


@pytest.mark.parametrize("event", EVENTS, ids=lambda event: type(event).__name__)
def test_an_event_survives_the_way_through_its_line(event: events.Event) -> None:
    line = encode(event)
    assert "\n" not in line
    assert decode(line) == event


def test_every_kind_of_event_is_covered() -> None:
    assert {type(event) for event in EVENTS} == set(events.Event.__args__)


@pytest.mark.parametrize(
    "line",
    [
        "",
        "error: a line for people",
        '{"event": "warning", "message": "another spelling"}',
        '{"event": "warning"}',
        '{"event": "unheard of"}',
        '{"event": ["list"]}',
        '{"event"',
        '{"other": 1}',
    ],
)
def test_other_lines_are_no_events(line: str) -> None:
    assert decode(line) is None


def test_warnings_of_recorder_and_set_up_reach_the_result(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """What the children print is what the launcher reads."""
    monkeypatch.setenv(events.EVENTS_VARIABLE, "1")
    warn("recorder", "topic /x has several types")
    warn("slip_sim_bridge.node", "core 7 is not available")
    launcher = Launcher(load_scenario("paper_planar"))
    for line in capsys.readouterr().out.splitlines():
        event = decode(line)
        assert event is not None, line
        launcher.note("recorder", event)
    assert launcher.warnings == ["recorder: topic /x has several types", "recorder: core 7 is not available"]


def test_without_a_parent_only_warnings_are_told(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv(events.EVENTS_VARIABLE, raising=False)
    emit(Ready())
    warn("recorder", "topic /x has several types")
    told = capsys.readouterr()
    assert (told.out, told.err) == ("", "warning: recorder: topic /x has several types\n")
