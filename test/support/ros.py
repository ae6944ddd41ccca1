"""Fixtures for tests over DDS: a domain per test, child processes that end with it, nothing left behind.

Use with ``pytest_plugins`` or by importing the fixtures into a conftest. Children are started by exec, never
by fork, because a process forked after `rclpy.init` has no DDS threads.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest

from slip_msgs_py.environment import Kind, choose_transport
from slip_vic.run.domain import domain_id
from slip_vic.run.processes import Child, ProcessGroup, child_environment

RESEND_S = 10.0
DEADLINE_S = 90.0  # for things that take well under a second on an idle machine


def wait_until(
    condition: Callable[[], bool], what: str, timeout_s: float = DEADLINE_S, seen: Callable[[], str] = lambda: ""
) -> None:
    """Poll until `condition` holds, or fail saying what was waited for, and what was `seen`."""
    end = time.monotonic() + timeout_s
    while not condition():
        if time.monotonic() > end:
            pytest.fail(f"waited {timeout_s:g} s for {what} {seen()}")
        time.sleep(0.005)


class Processes:
    """Starts and ends the child processes of one test, all in its DDS domain."""

    def __init__(self, group: ProcessGroup, environment: dict[str, str]) -> None:
        self.group = group
        self.environment = environment

    def start(self, name: str, argv: Sequence[str], **extra: str) -> Child:
        """Start a program; `extra` are further environment variables."""
        command, environment = [str(part) for part in argv], {**self.environment, **extra}
        return self.group.add(Child(name, command, environment, lambda *_: None))

    def python(self, name: str, *arguments: object, **extra: str) -> Child:
        """Start this interpreter with arguments such as ``-m module`` or a script."""
        return self.start(name, [sys.executable, *map(str, arguments)], **extra)

    def wait_event(self, child: Child, kind: Kind) -> Mapping[str, Any]:
        """Wait until a child has told an event; fail with its last lines where it ends first."""
        what = f"{kind} of {child.name}"
        wait_until(lambda: child.last.get(kind) is not None or child.poll() is not None, what)
        if child.last.get(kind) is None:
            child.has_ended(1.0)
        event = child.last.get(kind)
        assert event is not None, f"{child.name} ended with {child.poll()}:\n{child.tail()}"
        return event

    def wait_end(self, child: Child) -> int:
        """Wait until a child has ended by itself; return its exit code."""
        assert child.has_ended(DEADLINE_S), f"{child.name} did not end:\n{child.tail()}"
        assert child.poll() is not None
        return child.poll()

    def kill(self, child: Child) -> None:
        """Kill a child and wait for its end."""
        child.send_signal(signal.SIGKILL)
        self.wait_end(child)

    def stop(self, child: Child, signal_number: int) -> int:
        """Send a signal and wait for the end; return the exit code."""
        child.send_signal(signal_number)
        return self.wait_end(child)


@contextlib.contextmanager
def _domain() -> Iterator[int]:
    with domain_id() as domain, pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_DOMAIN_ID", str(domain))
        choose_transport()
        yield domain


@contextlib.contextmanager
def _processes(domain: int) -> Iterator[Processes]:
    environment = child_environment(domain)
    roots = sorted(str(path) for path in (Path(__file__).parents[2] / "src").iterdir() if path.is_dir())
    environment["PYTHONPATH"] = os.pathsep.join([*roots, environment.get("PYTHONPATH", "")]).rstrip(os.pathsep)
    with ProcessGroup() as group:
        yield Processes(group, environment)
        for child in group.children:  # pytest shows it where the test failed
            print(f"{child.name} (exit code {child.poll()}), last lines:\n{child.tail()}")
            assert " object at 0x" not in child.tail(), "a line of the log shows an object instead of its name"
            assert not any("failed in " in line for line in child.lines), "a bug that the node has outlived"


@contextlib.contextmanager
def node_in(domain: int) -> Iterator[object]:
    import rclpy
    from rclpy.node import Node

    context = rclpy.Context()
    rclpy.init(args=[], context=context, domain_id=domain)
    node = Node("test_node", context=context, start_parameter_services=False, enable_rosout=False)
    try:
        yield node
    finally:
        node.destroy_node()
        rclpy.try_shutdown(context=context)


@pytest.fixture
def ros_domain() -> Iterator[int]:
    """A DDS domain of the test's own on this machine, set in the environment of this process too."""
    with _domain() as domain:
        yield domain


@pytest.fixture
def processes(ros_domain: int) -> Iterator[Processes]:
    """Child processes in the test's domain; ended with the test."""
    with _processes(ros_domain) as started:
        yield started


@pytest.fixture
def ros_node(ros_domain: int) -> Iterator[object]:
    """An rclpy node in this process, in the test's domain and a context of its own."""
    with node_in(ros_domain) as node:
        yield node


@pytest.fixture(scope="module")
def shared_domain() -> Iterator[int]:
    """As `ros_domain`, for all tests of a file."""
    with _domain() as domain:
        yield domain


@pytest.fixture(scope="module")
def shared_processes(shared_domain: int) -> Iterator[Processes]:
    """As `processes`, for all tests of a file: what they need not start themselves."""
    with _processes(shared_domain) as started:
        yield started


@pytest.fixture(scope="module")
def shared_node(shared_domain: int) -> Iterator[object]:
    """As `ros_node`, for all tests of a file."""
    with node_in(shared_domain) as node:
        yield node


def call_service(node: Any, kind: Any, name: str, request: Any, wait: Callable[[Callable[[], bool], str], None]) -> Any:
    """Return a service's answer; `wait` spins until a condition holds, or says what it has waited for."""
    client = node.create_client(kind, name)
    wait(client.service_is_ready, name)
    answers = []

    def answered() -> bool:
        # A server that was killed is still known for a while, and takes a request to its grave.
        if time.monotonic() >= began_s + len(answers) * RESEND_S:
            answers.append(client.call_async(request))
        return any(answer.done() for answer in answers)

    began_s = time.monotonic()
    wait(answered, f"answer of {name}")
    node.destroy_client(client)
    return next(answer.result() for answer in answers if answer.done())
