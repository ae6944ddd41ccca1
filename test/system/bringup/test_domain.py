"""Listening before a run joins a domain, against a node of another program."""

import pytest
from std_msgs.msg import String

from slip_core.errors import InputError
from slip_vic.run.domain import check_alone, has_nodes


def test_another_publisher_of_a_topic_is_named(ros_domain: int, ros_node) -> None:
    ros_node.create_publisher(String, "/left/joint_states", 1)
    assert has_nodes(ros_domain)
    check_alone(ros_domain, ["/joint_states", "/left/wrench"])
    message = f"ROS domain {ros_domain}: got node /test_node, which publishes /left/joint_states"
    with pytest.raises(InputError, match=message):
        check_alone(ros_domain, ["/left/wrench", "/left/joint_states"])
