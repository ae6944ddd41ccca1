"""Listening before a run joins a domain, against a node of another program."""

from pathlib import Path

import pytest
from std_msgs.msg import String

from slip_core.errors import InputError
from slip_vic.run.domain import check_alone, has_nodes
from test.support.command import slip_vic


def test_another_publisher_of_a_topic_is_named(ros_domain: int, ros_node) -> None:
    ros_node.create_publisher(String, "/left/joint_states", 1)
    assert has_nodes(ros_domain)
    check_alone(ros_domain, ["/joint_states", "/left/wrench"])
    message = f"ROS domain {ros_domain}: got node /test_node, which publishes /left/joint_states"
    with pytest.raises(InputError, match=message):
        check_alone(ros_domain, ["/left/wrench", "/left/joint_states"])


def test_a_run_joins_a_domain_with_a_node_of_another_program(ros_domain: int, ros_node, tmp_path: Path) -> None:
    """In a process of its own, which has nothing loaded when it listens."""
    ros_node.create_publisher(String, "/joint_states", 1)
    words = ("--domain-id", ros_domain, "--namespace", "other", "--set", "bridge.duration_s=0.05")
    done = slip_vic("run", *words, folder=tmp_path)
    assert done.returncode == 0, done.stderr
