"""`slip-vic watch`: the page of a run while it runs, fed from the topics.

One loop takes the newest message of each topic some times a second; what came between is dropped by the middleware, so
the cost does not grow with the work of the page.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from rclpy.node import Node

from slip_core.errors import SlipVicError
from slip_core.stamps import stamp_to_ns
from slip_msgs_py.messages.from_msgs import vector6
from slip_msgs_py.qos import profile
from slip_vic.page.audience import Audience
from slip_vic.page.packing import Packer
from slip_vic.page.runs import describe, describe_plots, object_size, plot_series, series_of, tip_of
from slip_vic.page.urdf import box_of
from slip_vic.run.data import ArmData, Channel, RunData
from slip_vic.run.peer import Asker, Listener

MODE: Final = "controller/mode"
NEWEST: Final = ("joint_states", "wrench", "slip_truth", "controller/scalars", "object_state")
LATCHED: Final = ("robot_description", "object_description", MODE)
ASKED: Final = ("ee_frame", "governor.friction_limit", "governor.torsional_radius", "contacts.slip_axes")
NODE: Final = "slip_vic_controller"
DISCOVERY_S: Final = 1.0
FRAME_S: Final = 0.1
ASK_S: Final = 2.0
SILENT_S: Final = 2.0
"""So long without joint states the page reports that nothing arrives."""
NOW: Final = np.zeros(1)
SILENCE: Final = "No joint states arrive: the run has ended, or is paused. What was received stays."


@dataclass(slots=True)
class WatchedArm:
    """The topics of one namespace, and what was asked of its controller."""

    name: str
    topics: dict[str, Listener]
    parameters: dict[str, Any] = field(default_factory=dict)

    def text(self, name: str) -> str | None:
        """Return the text of a latched topic."""
        newest = self.topics[name].newest
        return None if newest is None else str(newest.data)

    @property
    def complete(self) -> bool:
        """Whether there is enough to draw the arm."""
        return self.topics["joint_states"].newest is not None and self.text("robot_description") is not None


class Watcher:
    """Follows the arms of a ROS domain and turns their newest messages into a model and frames.

    Args:
        node: in no executor.
        namespace: of the arm; "" takes every namespace in which there are joint states.
    """

    def __init__(self, node: Node, namespace: str) -> None:
        self._node, self._asker, self._wanted = node, Asker(node), namespace.strip("/")
        self.arms: list[WatchedArm] = []
        self._next_discovery = 0.0
        self._start_ns = 0
        self._described: tuple[object, ...] = ()
        self.last_ns = -1
        self.model: bytes | None = None

    def poll(self, now: float) -> bytes | None:
        """Return the next frame, None where nothing new has come.

        `model`, which says what stands in a frame, is set before the first; topics that appear later make another one.
        """
        if now >= self._next_discovery:
            self._next_discovery = now + DISCOVERY_S
            self._discover()
        fresh = [arm.topics["joint_states"].see() for arm in self.arms]
        if not any(fresh):
            return None
        for arm in self.arms:
            for name, topic in arm.topics.items():
                if name != "joint_states":
                    topic.see()
        ready = [arm for arm in self.arms if arm.complete]
        if not ready:
            return None
        stamp_ns = max(stamp_to_ns(arm.topics["joint_states"].newest.header.stamp) for arm in ready)
        if stamp_ns == self.last_ns:
            return None
        run = self._run(ready)
        described = description(run)
        if self.model is None or described != self._described:
            packer = Packer()
            runs = [describe(self._wanted or "live", run, packer)[0]]
            plots = describe_plots([run], packer, empty=True)
            self.model = packer.pack({"time": packer.add(NOW), "runs": runs, "plots": plots})
            self._described, self._start_ns = described, stamp_ns
        elif stamp_ns < self.last_ns:
            self._start_ns = stamp_ns  # a bag that is looped, a run that restarts: the page sees the time go back
        self.last_ns = stamp_ns
        return frame((stamp_ns - self._start_ns) * 1e-9, run)

    def modes(self) -> list[tuple[int, str]]:
        """Return the number and the mode of each arm whose mode has been published."""
        return [(k, text) for k, arm in enumerate(a for a in self.arms if a.complete) if (text := arm.text(MODE))]

    def _discover(self) -> None:
        known = {arm.name for arm in self.arms}
        for full, _ in self._node.get_topic_names_and_types():
            prefix, _, last = full.rpartition("/")
            name = prefix.strip("/")
            wanted = not self._wanted or name == self._wanted
            if last != "joint_states" or name in known or not wanted or not self._node.count_publishers(full):
                continue
            topics = {
                one: Listener(self._node, one, f"{prefix}/{one}", profile(1, reliable=latched, latched=latched))
                for latched, names in ((False, NEWEST), (True, LATCHED))
                for one in names
            }
            self.arms.append(WatchedArm(name, topics))
            with contextlib.suppress(SlipVicError):  # there may be no controller
                self.arms[-1].parameters = self._asker.parameters(f"{prefix}/{NODE}", ASKED, ASK_S)
            self.model = None  # the next frame makes another one

    def _run(self, arms: Sequence[WatchedArm]) -> RunData:
        pose, bridge = None, dict[str, Any]()
        for arm in arms:
            newest, text = arm.topics["object_state"].newest, arm.text("object_description")
            if newest is not None:
                at, turned = newest.pose.pose.position, newest.pose.pose.orientation
                pose = Channel(NOW, np.array([[at.x, at.y, at.z, turned.x, turned.y, turned.z, turned.w]]))
                if text is not None:
                    bridge["display.object_size"] = box_of(text)
                break
        return RunData(tuple(map(arm_now, arms)), pose, bridge, {})


def arm_now(watched: WatchedArm) -> ArmData:
    """Return what the page shows of an arm, for one instant."""
    newest = {name: topic.newest for name, topic in watched.topics.items()}
    states, truth, scalars = newest["joint_states"], newest["slip_truth"], newest["controller/scalars"]
    wrench = newest["wrench"]
    mode, names, none = watched.text(MODE), tuple(states.name), np.full((1, 6), np.nan)
    symbols: dict[str, float] = {} if scalars is None else dict(zip(scalars.name, scalars.position, strict=True))
    rows = {
        "joints": np.array([states.position]),
        "slip_velocity": none if truth is None else np.array([truth.velocity]),
        "slip": none if truth is None else np.array([truth.position]),
        "effort": np.array([[symbols.get(f"effort_{joint + 1}", np.nan) for joint in range(len(names))]]),
        "wrench": none if wrench is None else vector6(wrench.wrench.force, wrench.wrench.torque)[None],
    }
    if scalars is not None:
        rows["law"] = np.array([scalars.position])
    return ArmData(
        watched.name,
        watched.text("robot_description") or "",
        names,
        watched.parameters,
        {name: Channel(NOW, values) for name, values in rows.items()},
        tuple(symbols),
        () if mode is None else ((0.0, mode),),
    )


def description(run: RunData) -> tuple[object, ...]:
    """Return what a model is made of: one with the same describes the frames of another run too."""
    arms = ((arm.name, arm.urdf, tip_of(arm), arm.joint_names, *series_of(arm)) for arm in run.arms)
    return (run.object_pose is not None, object_size(run), *arms)


def frame(time_s: float, run: RunData) -> bytes:
    """Return one instant as float32: time, per arm joints and slip velocity, the object's pose, every series."""
    parts = [np.array([time_s])]
    for arm in run.arms:
        parts += [arm.channel("joints").rows.ravel(), arm.channel("slip_velocity").rows.ravel()]
    parts += [] if run.object_pose is None else [run.object_pose.rows.ravel()]
    parts += [values for _, rows in plot_series([run]) for _, _, values in rows]
    return np.concatenate(parts).astype("<f4").tobytes()


def watch(node: Node, audience: Audience, namespace: str, stop: Callable[[], object]) -> None:
    """Feed the browsers until it is stopped; without any the topics are read once a second only."""
    watcher = Watcher(node, namespace)
    model: bytes | None = None
    newest, modes, silent = time.monotonic(), list[tuple[int, str]](), False
    while not stop():
        now = time.monotonic()
        data = watcher.poll(now)
        if watcher.model is not None and watcher.model is not model:
            model, modes = watcher.model, watcher.modes()  # the model has the modes of its beginning
            audience.begin(model)
        if data is not None:
            newest = now
            audience.send(data)
            before, modes = modes, watcher.modes()
            for arm, text in (one for one in modes if one not in before):
                audience.tell(arm=arm, mode=text)
        if model is not None and silent != (now > newest + SILENT_S):
            silent = not silent
            audience.tell("ended", ended=SILENCE if silent else "")
        time.sleep(FRAME_S if audience.present or model is None else min(1.0, DISCOVERY_S))
