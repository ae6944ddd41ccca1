"""``slip-vic bringup``."""

from __future__ import annotations

import os
from pathlib import Path

import click

from slip_vic.options import out_option


@click.command()
@click.option("--namespace", default="", help="ROS namespace of the controller")
@click.option("--domain-id", type=int, help="ROS domain id; default ROS_DOMAIN_ID")
@click.option("--simulated", is_flag=True, help="without a person: the hand of the simulated arm pushes")
@out_option("bringup.yaml", "parameter file")
def bringup(namespace: str, domain_id: int | None, simulated: bool, out: Path) -> None:
    """Bring a controller and its drivers up, step by step, from topics and signs to a first governed motion.

    Both must run; the controller with trajectory.kind goal, governor.mode slow_down, governor.friction unknown and
    safety.auto_enable false. Each step shows what it measured and what it expects. Exit code 1 where a step does not
    hold, with one line on what to do. What was measured of the sensors is written to --out, for the controller
    after its own file, and for `slip-vic check --params` and `slip-vic run --params`.
    """
    if domain_id is not None:
        os.environ["ROS_DOMAIN_ID"] = str(domain_id)
    from slip_msgs_py.without_ros import check_ros
    from slip_vic.scenarios.parameter_files import check_writable, write_files

    check_ros()
    check_writable(out)  # here, not after the walk
    from slip_bags.ros_node import ros_node
    from slip_vic.setup.bringup.hands import Hands, Person, simulated_hand
    from slip_vic.setup.bringup.ros_system import RosSystem
    from slip_vic.setup.bringup.walk import Walk

    with ros_node("slip_vic_bringup") as node:
        system = RosSystem(node, namespace)
        try:
            bridge = system.bridge_parameters(["hold.stiffness", "grip.force"]) if simulated else {}
            hands: Hands = simulated_hand(system, bridge) if simulated else Person(system, system.params.joint_names)
            walk = Walk(system, hands)
            for verdict in walk.steps():
                click.echo(str(verdict), err=not verdict.holds)
                if not verdict.holds:
                    raise click.exceptions.Exit(1)
        finally:
            system.close()
    write_files(out.parent, {out.name: walk.parameter_file()})
    click.echo(f"{out}: noise, rate and latency as measured")
