"""The processes of a campaign over DDS, and what a user or an operator does to them."""

from __future__ import annotations

import contextlib
import math
import resource
import signal
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

from slip_bags.reader import Bag
from slip_core.arms import prefix_of
from slip_core.errors import InputError
from slip_msgs_py.events import Event, Failed, Ready, Started, Status
from slip_vic.run.node_command import node_command
from slip_vic.run.processes import Child, ProcessGroup, python_module
from slip_vic.scenarios.scenario import Scenario
from test.campaigns.faults.network import Cable
from test.campaigns.faults.plan import BRIDGE, CONTROLLER, RECORDER
from test.campaigns.faults.proxy import remappings

BLOCK_BYTES = 4096  # of a file system: what a file has beyond its end when the disk is full
# A full disk refuses to grow in sum, this limit each file: metadata.yaml needs more than a young bag has.
END_BYTES = 1 << 16
UP: Mapping[str, type[Event]] = {CONTROLLER: Ready, BRIDGE: Started}
"""What a node tells when its process has started, its topics are matched and it begins."""
START_S = 60.0  # a busy machine takes long to start a process, and longer where it compiles first
SILENT_S = 15.0


class StartUp:
    """Tells a node that is deaf from one that is still starting.

    Fast DDS's shared memory can leave a node deaf that was killed and started at once: a peer goes on writing into the
    file of the dead one (docs/safety.md). It runs and is never heard.
    """

    def __init__(self) -> None:
        self._began_s = self.last_s = -math.inf
        """When the newest start began, and when a node was starting for the last time."""

    def begin(self, now_s: float) -> None:
        """A process is started."""
        self._began_s = self.last_s = now_s

    def deaf(self, now_s: float, up: bool, heard_s: float) -> bool:
        """Return whether nodes that run are deaf; up: all have told that they begin; heard_s: newest sign of life."""
        if not up:
            self.last_s = now_s
            return now_s - self._began_s > START_S
        return now_s - max(self.last_s, heard_s) > SILENT_S


class Nodes:
    """Starts, stops and kills the nodes, and calls their services.

    Args:
        node: an rclpy node of our own.
        group: owner of the children.
        environment: of the children.
        scenario: parameters of both nodes.
        folder: for parameter files and bags.
        cable: to a bridge in a network of its own; None where that is not permitted.
    """

    def __init__(
        self,
        node: Any,
        group: ProcessGroup,
        environment: Mapping[str, str],
        scenario: Scenario,
        folder: Path,
        cable: Cable | None,
    ) -> None:
        self.group, self.environment, self.folder, self.cable = group, environment, folder, cable
        self.scenario = scenario
        self._children: dict[str, Child] = {}
        self._leaving: dict[str, Child] = {}
        self._bags = 0
        self._bag = folder
        self._remote = False
        self.starts = 0
        self._grips = {prefix: node.create_publisher(Float64, f"{prefix}grip_force", 10) for prefix, _ in scenario.arms}
        triggers = {
            "enable": "/slip_vic_controller/enable", "hold": "/slip_vic_controller/hold",
            "reset_fault": "/slip_vic_controller/reset_fault", "reset": "/slip_sim_bridge/reset",
        }  # fmt: skip
        self._triggers = {key: node.create_client(Trigger, name) for key, name in triggers.items()}
        self._set = node.create_client(SetParameters, "/slip_vic_controller/set_parameters")

    def runs(self, name: str) -> bool:
        """Return whether a node's process lives."""
        child = self._children.get(name)
        return child is not None and child.exit_code is None

    def up(self) -> bool:
        """Return whether controller and bridge run and have told that they begin."""
        children = ((self._children.get(name), event) for name, event in UP.items())
        return all(child is not None and child.exit_code is None and child.last(event) for child, event in children)

    def pid(self, name: str) -> int:
        """Return the process id of a node, 0 where it does not run."""
        return self._children[name].pid if self.runs(name) else 0

    def start(self, name: str) -> None:
        """Start a node."""
        self.starts += 1
        if name in self._leaving:  # two of them would be heard
            self.group.stop([self._leaving.pop(name)])
        extra = remappings(self._grips) if name == BRIDGE else []
        argv = node_command(name, getattr(self.scenario, name), self.folder, *extra)
        if name == BRIDGE and self._remote and self.cable is not None:
            argv = self.cable.behind(argv)
        self._children[name] = self.group.start(name, argv, self.environment, lambda *_: None)

    def place_bridge(self, remote: bool) -> bool:
        """Let the bridge run behind the cable, or not; return whether it had to be ended for that."""
        if remote == self._remote:
            return False
        self._remote = remote
        self.end(BRIDGE)
        return True

    def start_recorder(self) -> None:
        """Start a recorder of all topics."""
        self._bags += 1
        self._bag = self.folder / f"bag_{self._bags}"
        words = ["record", "--out", str(self._bag), "--all", "--flush-period", "0.1"]
        argv = python_module("slip_bags.cli", *words)
        self._children[RECORDER] = self.group.start(RECORDER, argv, self.environment, lambda *_: None)

    def records(self) -> bool:
        """Return whether the recorder has written something."""
        child = self._children.get(RECORDER)
        status = child.last(Status) if child is not None else None
        return status is not None and status.messages > 0

    def fill_disk(self) -> None:
        """Let the recorder's files grow no more from now on, as on a full disk: by its limit of the size of files."""
        child = self._children.get(RECORDER)
        if child is not None and child.exit_code is None:
            largest = max((file.stat().st_size for file in self._bag.iterdir()), default=0)
            limit = -(-max(largest, END_BYTES) // BLOCK_BYTES) * BLOCK_BYTES
            with contextlib.suppress(ProcessLookupError):
                resource.prlimit(child.pid, resource.RLIMIT_FSIZE, (limit, limit))

    def judge_full_disk(self) -> str:
        """Return what is wrong with how a recorder ended whose disk was full, an empty text where nothing is."""
        child = self._children.get(RECORDER)
        if child is None or not child.wait(0.0):
            return "recorder went on though its disk is full"
        failed = child.last(Failed)
        if child.exit_code != 1 or failed is None:
            return f"recorder ended with exit code {child.exit_code} on a full disk:\n{child.tail()}"
        try:
            # A recording of a second may lose all to the room that its end needs; but then it says so.
            with Bag(self._bag) as bag:
                said = f"with the {bag.message_count} messages before" in failed.text
                return "" if said else f"bag holds {bag.message_count} messages, but: {failed.text}"
        except InputError as error:
            return f"bag is not readable after a full disk: {error}; the recorder said: {failed.text}"

    def ended(self, name: str) -> str:
        """Return how a node ended that should run, an empty text where it runs."""
        child = self._children.get(name)
        if child is None or child.exit_code is None:
            return ""
        child.wait(1.0)
        del self._children[name]
        return f"{name} ended with exit code {child.exit_code}:\n{child.tail()}"

    def send(self, name: str, number: int) -> None:
        """Send a signal."""
        if name in self._children:
            self._children[name].send(number)

    def kill(self, name: str) -> None:
        """Kill -9, and take notice."""
        child = self._children.pop(name, None)
        if child is not None:
            child.send(signal.SIGKILL)
            child.wait(5.0)

    def let_go(self, name: str) -> None:
        """Ask a process to end, without waiting for it; it does not count as one that should run any more."""
        child = self._children.pop(name, None)
        if child is not None:
            child.send(signal.SIGCONT)
            child.send(signal.SIGINT)
            self._leaving[name] = child

    def end(self, name: str) -> None:
        """End a process as a user would, where it runs."""
        child = self._children.pop(name, None)
        if child is not None:
            self.group.stop([child])

    def trigger(self, key: str) -> None:
        """Call a service without waiting for its answer."""
        client = self._triggers[key]
        if client.service_is_ready():
            client.call_async(Trigger.Request())

    def set_grip(self, arm: str, force: float) -> None:
        """Set the grip force of an arm [N]."""
        self._grips[prefix_of(arm)].publish(Float64(data=force))

    def set_parameters(self, values: Mapping[str, Any]) -> None:
        """Change parameters of the controller."""
        if self._set.service_is_ready():
            request = SetParameters.Request()
            request.parameters = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
            self._set.call_async(request)
