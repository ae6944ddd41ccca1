"""``slip-vic export``: the control cycle as a C library, with the configuration and a recorded run of a scenario."""

from __future__ import annotations

import sysconfig
from collections.abc import Sequence
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

import click
import numpy as np

from slip_bags.cli import echo
from slip_core.arrays import Array
from slip_core.types import SlipSample
from slip_vic.options import Choice, choosing, out_option

if TYPE_CHECKING:
    from slip_vic.run.in_process import ClosedLoop, Tick
    from slip_vic.scenarios.scenario import Scenario
    from slip_vic_controller.interfaces import SlipFromDisplacement


@click.command()
@choosing("scenario", "law", "mode", "seed", "sensor", "drive", "gripper", "parameters", "set")
@click.option("--cpu", default="", help="oldest supported processor, or native; default x86-64-v2, else native")
@out_option("slip_vic_native", "folder")
def export(*, choice: Choice, cpu: str, out: Path) -> None:
    """Write the control cycle as a C library: libslip_vic.so and .a, slip_vic.h, an example, and a scenario's numbers.

    controller.bin and state.bin are configuration and initial state; run.bin is a run of the scenario that example.c
    replays bit by bit. node/ is a controller node for one arm in C++, with the same files. The library comes from the
    installed wheel; a checkout, and --cpu, compile it in about a minute.
    """
    from slip_native.files import copy_carried, sources
    from slip_vic.scenarios.parameter_files import write_files
    from slip_vic.scenarios.scenario import load

    loaded = load(**choice)
    write_files(out, {})  # an unwritable folder fails here, before the minute of compiling
    if cpu or not copy_carried(out):
        from slip_native.library import build

        echo("compiling the cycle for C, about a minute", err=True)
        build(out, cpu)
    write_files(out, sources())
    write_node(loaded, out)
    write_run(loaded, out)
    site = Path(sysconfig.get_path("purelib"))
    prefixes = f"{sysconfig.get_path('data')};{site / 'cmeel.prefix'}"
    echo(f"{out}: libslip_vic.so, libslip_vic.a, slip_vic.h, controller.bin, state.bin, run.bin, example.c, node")
    echo(
        f"next: cmake -S {out} -B {out}/build -DCMAKE_PREFIX_PATH='{prefixes}' && cmake --build {out}/build "
        f"&& {out}/build/example {out}/run.bin && {out}/build/slip_vic_node {out}"
    )


def write_node(scenario: Scenario, folder: Path) -> None:
    """Write controller.bin and state.bin of a scenario, and the node's parameters, arm, and profile of DDS."""
    from slip_core.files.urdf import usable_urdf
    from slip_vic.scenarios.parameter_files import write_files
    from slip_vic.scenarios.scenario import NODES, ros_parameter_file
    from slip_vic_controller.config.controller import Controller

    (params, urdf), *_ = zip(scenario.controllers.values(), scenario.placed.values(), strict=True)
    profile = resources.files("slip_msgs_py").joinpath("localhost.xml")
    texts = {
        "controller.yaml": ros_parameter_file(params, NODES["controller"][0]),
        "arm.urdf": usable_urdf(urdf, params.ee_frame, params.joint_names),
        "localhost.xml": profile.read_text(encoding="utf-8"),
    }
    write_files(folder, texts)
    controller = Controller(scenario.controllers, scenario.placed, lockstep=params.mode == "lockstep")
    controller.config.tofile(folder / "controller.bin")
    controller.new_state().tofile(folder / "state.bin")


def write_run(scenario: Scenario, folder: Path) -> None:
    """Run a scenario in lockstep, and write run.bin; all numbers have 8 bytes.

    run.bin: number of arms, of rows per observer, of ticks, and of values in the state; the first state; the ticks; the
    last state. A tick: whether CONFIG follows, samples, a joint state, INPUTS and OUTPUTS of each arm.
    """
    from slip_vic.run.in_process import ClosedLoop, run_in_process
    from slip_vic_controller.interfaces import SlipFromDisplacement

    loop = ClosedLoop(scenario)
    slips_of = [SlipFromDisplacement() for _ in loop.session.arms]
    config, first, given, ticks = loop.session.config, loop.session.buffer.copy(), None, []
    for tick in run_in_process(scenario, loop):
        changed = [] if config is given else [config]
        ticks.append(np.concatenate([_whole(len(changed)), *changed, *_tick(loop, tick, slips_of)]))
        given, config = config, loop.session.config  # a tare has changed it for the next tick
    head = _whole(len(loop.session.arms), loop.session.controller.rows, len(ticks), len(first))
    np.concatenate([head, first, *ticks, loop.session.buffer]).tofile(folder / "run.bin")


def _tick(loop: ClosedLoop, tick: Tick, slips_of: Sequence[SlipFromDisplacement]) -> list[Array]:
    """Return the samples before a cycle, its joint states, inputs and outputs."""
    samples, joints = [], []
    for arm, sent, slip_of in zip(loop.session.arms, tick.outputs.arms, slips_of, strict=True):
        slips = [(one.stamp_ns, one if isinstance(one, SlipSample) else slip_of(one)) for one in sent.slips]
        for of, contact in arm.routes[0]:
            for wrench in sent.wrenches if of.controller.params.wrench.source == "sensor" else ():
                stamp_ns = wrench.stamp_ns
                samples.append(_sample(0, of.index, contact, stamp_ns, stamp_ns, True, wrench.wrench))
            for arrival_ns, slip in slips:
                if slip is not None:
                    samples.append(_sample(1, of.index, contact, slip.stamp_ns, arrival_ns, slip.valid, slip.twist))
        joint = sent.joint
        joints += [_whole(len(joint.position), joint.stamp_ns), joint.position, joint.velocity, joint.effort]
    exchange = [*(result.inputs for result in tick.results), *(result.outputs for result in tick.results)]
    return [_whole(len(samples)), *samples, *joints, *exchange]


def _sample(kind: int, arm: int, contact: int, stamp_ns: int, arrival_ns: int, valid: bool, six: Array) -> Array:
    return np.concatenate([_whole(kind, arm, contact, stamp_ns, arrival_ns, valid), six])


def _whole(*values: int) -> Array:
    """Return whole numbers as they lie in a file of doubles."""
    return np.array(values, np.int64).view(np.float64)
