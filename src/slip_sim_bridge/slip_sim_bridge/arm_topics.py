"""Topics of one arm at the bridge: what its sensors measure goes out, its command and grip come in."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from slip_core.arrays import Array
from slip_core.types import AXES, JointCommand
from slip_msgs_py.fast_io import Refusals, create_receiver, create_sender
from slip_msgs_py.messages import from_msgs, to_msgs
from slip_msgs_py.node_shell import NodePart
from slip_msgs_py.qos import create_publisher, create_subscription
from slip_sim_bridge.params import BridgeParams
from slip_sim_bridge.session import ArmOutputs


class ArmTopics:
    """What one arm of the bridge publishes and receives.

    Args:
        node: owner of everything.
        prefix: of its topics; empty where it is the only one.
        params: of this arm.
        urdf: of this arm, as it stands in the world.
        refusals: messages that could not be read, for the report.
        on_command: called when a command has come.
        on_grip_command: called when a grip force has come, where `grip.control` is follow.
    """

    def __init__(
        self, node: Any, prefix: str, params: BridgeParams, urdf: str, refusals: Refusals,
        on_command: Callable[[JointCommand], None], on_grip_command: Callable[[Any], None],
    ) -> None:  # fmt: skip
        self.prefix, self._lockstep = prefix, params.mode == "lockstep"
        part = NodePart(node, prefix)
        interface = params.drive.interface
        self.command_topic = f"{prefix}{interface}_command"
        names, frame = params.joint_names, params.ee_frame

        self._send_joint = create_sender(part, "joint_states", to_msgs.joint_state(names))
        self._send_wrench = create_sender(part, "wrench", to_msgs.wrench(frame))
        kinds: dict[str, tuple[str, to_msgs.Form, Any]] = {
            "twist": ("slip_velocity", to_msgs.twist(frame), to_msgs.slip_numbers),
            "displacement": ("slip_displacement", to_msgs.pose(frame), lambda sample: sample.pose),
            "flag": (
                "slip_flag",
                to_msgs.joint_state(("slip",), "position"),
                lambda sample: to_msgs.slip_numbers(sample)[:1],
            ),
        }
        name, form, self._slip_numbers = kinds[params.slip_input]
        self._send_slip = create_sender(part, name, form)
        self._send_truth = create_sender(
            part, "slip_truth", to_msgs.joint_state([f"s_{axis}" for axis in AXES], "position", "velocity")
        )
        create_publisher(part, "robot_description").publish(to_msgs.string(urdf))
        self.sub_command = create_receiver(
            part,
            f"{interface}_command",
            lambda message: from_msgs.joint_command(message, names, interface),
            on_command,
            refusals,
            depth=10,
            reliable=self._lockstep,
        )
        self._no_wrench = params.sensors.wrench.silent
        self.follows = params.grip.control == "follow"
        if self.follows:
            create_subscription(part, "grip_command", on_grip_command, depth=1000, reliable=self._lockstep)
        self._send_internal = create_sender(part, "internal_wrench", to_msgs.wrench(frame)) if prefix else None

    @property
    def state_publishers(self) -> list[Any]:
        """Publishers of what a controller waits for; a wrench sensor that is silent from the start is none."""
        senders = (self._send_joint, self._send_slip, *(() if self._no_wrench else (self._send_wrench,)))
        return [sender.publisher for sender in senders]

    def publish(self, outputs: ArmOutputs) -> None:
        """Send what the controller waits for."""
        joint = outputs.joint
        for wrench in outputs.wrenches:
            self._send_wrench.send(wrench.stamp_ns, wrench.wrench)
        for slip in outputs.slips:
            self._send_slip.send(slip.stamp_ns, self._slip_numbers(slip))
        self._send_joint.send(joint.stamp_ns, joint.position, joint.velocity, joint.effort)

    def publish_truth(self, stamp_ns: int, outputs: ArmOutputs, internal: Array | None) -> None:
        """Send what no controller waits for.

        internal: of several arms, the part of the pad's wrench that does not move the object; (6,) [N, N m] {ee}.
        """
        truth = outputs.readings.truth
        self._send_truth.send(stamp_ns, truth.slip_displacement, truth.slip_velocity)
        if self._send_internal is not None and internal is not None:
            self._send_internal.send(stamp_ns, internal)
