"""What of a node can be reached from another machine: nothing, unless somebody says otherwise."""

# ruff: noqa: F811 - fixtures are found by name

from __future__ import annotations

import socket
import sys
from pathlib import Path
from typing import Any

import psutil
import pytest

from test.campaigns.faults.network import own_network
from test.support.ros import Processes
from test.system.nodes.test_modes import BRIDGE_ENDLESS, CONTROLLER_SLOW, Watcher, start, watcher  # noqa: F401

LOOPBACK = "127.0.0.1"


def unread(port: int) -> bool:
    """Return whether a datagram to a port stays where it is: a socket that only sends."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.sendto(b"anybody there?", (LOOPBACK, port))
    line = next(line.split() for line in Path("/proc/net/udp").read_text().splitlines() if f":{port:04X} " in line)
    return int(line[4].partition(":")[2], 16) > 0


def assert_loopback_only(pid: int) -> None:
    sockets = psutil.Process(pid).net_connections("inet")
    assert any(each.laddr.ip == LOOPBACK for each in sockets)
    open_to_all = [each.laddr for each in sockets if each.laddr.ip != LOOPBACK]
    assert all(unread(address.port) for address in open_to_all if address.ip == "0.0.0.0"), open_to_all


def test_nodes_listen_on_the_loopback_interface_only(watcher: Watcher, start: Any) -> None:
    nodes = [start("controller", *CONTROLLER_SLOW), start("bridge", *BRIDGE_ENDLESS)]
    watcher.wait_law()
    for node in nodes:
        assert_loopback_only(node.pid)


def test_another_machine_hears_nothing_unless_it_may(processes: Processes) -> None:
    """It names this machine as a static peer, which LOCALHOST as the discovery range alone does not prevent."""
    unshare = own_network()
    if not unshare:
        pytest.skip("network namespaces are not permitted here")
    child = processes.start("machines", [*unshare, sys.executable, "-m", "test.system.nodes.two_machines"])
    assert processes.wait_end(child) == 0, child.tail()
    assert "joint_states: nothing, 0 known" in child.tail()
    assert "wrench: heard, 1 known" in child.tail()
