"""Start bridge, controller and recorder as processes on DDS, watch them, end them; nothing is left behind."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from slip_core.errors import InputError, ProtocolError
from slip_core.types import Incident
from slip_msgs_py.environment import Event, check_ros
from slip_msgs_py.stop_flag import StopFlag
from slip_vic.run.commands import native_command, node_command, recorded_topics, recorder_command
from slip_vic.run.domain import check_alone, domain_id
from slip_vic.run.processes import Child, ProcessGroup, child_environment, placed
from slip_vic.scenarios.scenario import Scenario

POLL_S = 0.02
TIMING = ("fresh", "overruns", "missed", "latency")


@dataclass(frozen=True, slots=True)
class RunResult:
    """What a finished run reports: ticks, simulated and wall time, recorder's counts, where the bag is.

    timing: in real time the share of fresh ticks, overruns, states missed by the controller and state-to-command
    latencies [s]; else empty.
    warnings: of the processes, one line each.
    incidents: what went wrong although no process failed, in the order of its time.
    """

    ticks: int
    sim_time_s: float
    wall_time_s: float
    bag: Path | None
    messages: int
    lost: int
    timing: Mapping[str, float]
    warnings: tuple[str, ...]
    incidents: tuple[Incident, ...] = ()

    @property
    def real_time_factor(self) -> float:
        """Simulated over wall time."""
        return self.sim_time_s / self.wall_time_s if self.wall_time_s > 0.0 else 0.0


class Launcher:
    """One run of a scenario.

    In real time bridge and controller have one of the last two cores each, and the recorder the others.

    Args:
        scenario: parameters of both nodes.
        bag: folder to record into, None records nothing; it must not exist yet.
        wanted_domain: ROS domain id; None: a free one.
        namespace: ROS namespace of all nodes.
        fifo: SCHED_FIFO priority of bridge and controller, 1 to 99; None: they have a normal one.
        native: folder of a `slip-vic export` whose node is the controller; None: the Python node.

    Raises:
        InputError: parameters and URDF that do not fit, a bag folder that is taken, an export that does not fit.
    """

    def __init__(
        self,
        scenario: Scenario,
        *,
        bag: Path | None = None,
        wanted_domain: int | None = None,
        namespace: str = "",
        fifo: int | None = None,
        native: Path | None = None,
    ) -> None:
        self._scenario, self._bag, self._native = scenario, bag, native
        self._on_progress: Callable[[float], None] = lambda _: None
        self._wanted_domain = wanted_domain
        self._namespace = f"/{namespace.strip('/')}" if namespace else ""
        self._fifo = fifo
        self.warnings: list[str] = []
        self._incidents: list[Incident] = []
        self._stop = StopFlag()
        check_ros()
        scenario.check()
        if native is not None:
            native_command(native, next(iter(scenario.controllers.values())))
        if bag is not None:
            _check_new_folder(bag)

    def run(
        self, on_progress: Callable[[float], None] = lambda _: None, on_domain: Callable[[int], None] = lambda _: None
    ) -> RunResult:
        """Run to the end; `on_progress` is called with the simulated time [s], from a reader thread.

        Args:
            on_progress: see above.
            on_domain: is called with the ROS domain id, before anything is started.

        Raises:
            ProtocolError: the first child that failed, with its exit code and last lines, or a missed deadline.
            InputError: SIGINT, SIGTERM or SIGHUP came first; everything was closed in order.
        """
        self._on_progress = on_progress
        with (
            self._stop,
            domain_id(self._wanted_domain, self._namespace) as domain,
            tempfile.TemporaryDirectory(prefix="slip_vic_") as folder,
            ProcessGroup() as group,
        ):
            if self._wanted_domain is not None:
                topics = (name for name in recorded_topics(self._scenario) if not name.startswith("/"))
                check_alone(domain, (f"{self._namespace}/{name}" for name in topics))
            on_domain(domain)
            return self._supervise(group, domain, Path(folder))

    def _supervise(self, group: ProcessGroup, domain: int, folder: Path) -> RunResult:
        environment, scenario = child_environment(domain), self._scenario
        # The bridge starts last: it needs the others, and its first output is the run's first tick.
        words = ["-r", f"__ns:={self._namespace}"] if self._namespace else []
        free = sorted(os.sched_getaffinity(0))
        cores = free[-2:] if scenario.first.mode == "realtime" and len(free) > 1 else []
        order: dict[str, list[str]] = {}
        if self._bag is not None:
            recorder = recorder_command(scenario, self._bag, folder, self._namespace)
            order["recorder"] = placed(recorder, free[:-2] if cores else ())
        counts = {
            "expected_subscribers": 1 if self._bag is None else 2
        }  # each waits for the other one and the recorder
        ready = replace(
            scenario,
            controllers={name: params.model_copy(update=counts) for name, params in scenario.controllers.items()},
            bridges={name: params.model_copy(update=counts) for name, params in scenario.bridges.items()},
        )
        for name, own in (("controller", cores[-1:]), ("bridge", cores[:1])):
            if name == "controller" and self._native is not None:
                command = native_command(self._native, next(iter(ready.controllers.values())), *words)
            else:
                command = node_command(name, getattr(ready, name), folder, *words)
            order[name] = placed(command, own, self._fifo)
        children = {name: group.add(Child(name, argv, environment, self.note)) for name, argv in order.items()}
        self._wait(group, children["bridge"])
        group.stop([children["controller"]])
        group.stop([child for child in group.children if child.name == "recorder"])
        group.check()
        result = self._result(children)
        self._on_progress(result.sim_time_s)
        return result

    def note(self, name: str, event: Event) -> None:
        """Take one event of a child; called from its reader thread."""
        if event.kind == "warning":
            self.warnings.append(f"{name}: {event.values['text']}")
        elif event.kind == "progress":
            self._on_progress(event.values["sim_time_s"])
        elif event.kind == "incident":
            self._incidents.append(Incident(**event.values))

    def _wait(self, group: ProcessGroup, bridge: Child) -> None:
        """Wait for the end of the bridge, which does not wait for the other processes without end."""
        while bridge.poll() is None:
            time.sleep(POLL_S)
            if self._stop():
                # Without a recorder no process needs what is still on its way.
                group.stop([child for child in group.children if child.name != "recorder"], in_haste=self._bag is None)
                group.stop(group.children)
                ended = next((child.results for child in group.children if child.name == "bridge"), {})
                when = f"after {ended['sim_time_s']:.3f} s" if ended else "before the start"
                raise InputError("interrupted", got=f"a signal {when}", expected="the run's full duration")
            group.check()
            if left := [child.name for child in group.children if child is not bridge and child.poll() == 0]:
                raise ProtocolError(f"{left[0]} was shut down before the end of the run")

    def _result(self, children: dict[str, Child]) -> RunResult:
        done, controller = children["bridge"].results, children["controller"].results
        recorded = children["recorder"].results if self._bag else {}
        if not done:
            raise ProtocolError(f"bridge ended without a result; last lines:\n{children['bridge'].tail()}")
        timed = {**done, **controller} if self._scenario.first.mode == "realtime" else {}
        return RunResult(
            ticks=int(done["ticks"]),
            sim_time_s=float(done["sim_time_s"]),
            wall_time_s=float(done["wall_time_s"]),
            bag=self._bag,
            messages=int(recorded.get("messages", 0)),
            lost=int(recorded.get("lost", 0)),
            timing={key: float(value) for key, value in timed.items() if key.startswith(TIMING)},
            warnings=tuple(self.warnings),
            incidents=tuple(sorted(self._incidents, key=lambda incident: incident.time_s)),
        )


def _check_new_folder(bag: Path) -> None:
    try:
        bag.mkdir(parents=True)
        bag.rmdir()
    except OSError as error:
        fix = "remove it or choose another"
        raise InputError(f"bag folder {bag}", got=error, expected="a new folder that can be written", fix=fix) from None
