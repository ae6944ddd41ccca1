"""A second physics engine judges the simulated grasp: Drake, patch contact (hydroelastic), solver SAP.

Two compliant round pads press a rigid plate; the hand moves as in a run of ours, or stands still while the plate is
pushed. Drake knows nothing of limit surfaces: it has Coulomb friction in every point of the patch. In discrete Drake
static and sliding friction are equal, so that the bridge has friction `coulomb` in all that is compared.

The bars below were written down before the first run, and stay as they are. `docs/fidelity.md` has what came of it.
"""

from __future__ import annotations

import functools
import itertools
from typing import Final

import numpy as np
import pytest

from slip_sim_bridge import simulation
from slip_vic.run.in_process import run_in_process
from slip_vic.scenarios.scenario import load

pytest.importorskip("pydrake", reason="Drake is not installed: pip install 'slip-vic[referee]'")
from .drake_world import DrakePlant, drake_plant  # needs Drake

pytestmark = pytest.mark.referee

CREEP_M_S: Final = 20e-6
"""At 0.9 of the limit and steps of 1 ms the plate creeps by less. Loads: force along x and y of the pads, torque about
their normal; speed: mean over the second second of a constant load, turning times the torsional radius."""

BREAK_AWAY: Final = 0.10
"""Share by which force and torque at break-away differ from our limit surface |(f_x, f_y, tau / rho)| = mu N at most,
rho = 2/3 of the pads' radius (uniform pressure). Five directions: force along x and along y, torque, and force with
torque at 30 and 60 degrees of the scaled plane. The load rises from 0.8 to 1.2 of the limit in 2 s; break-away is where
the scaled speed passes 0.1 mm/s, five times the creep that is allowed below."""

PATH: Final = 0.15
"""Share by which the slip path of `paper_planar`, law classical, differs at most: final displacement, final angle, and
the largest distance at any time, of displacement as of angle, over the largest displacement, angle of ours."""

GOVERNED_M: Final = 0.1e-3
"""A governed run whose governor is configured with 10 % less friction than there is slips by less at any time, in Drake
too: displacement, and angle times the torsional radius."""

LOOP_VIC: Final = 0.1, 1e-3
"""The whole loop, the controller against Drake's arm, pads and plate. Classical: the bars of PATH at the end, and
GOVERNED_M where friction is configured 10 % low. The law (vic): peak slip below this share of classical's, and within
this many metres of the peak that the bridge has."""

LOOP_GOVERNED_M: Final = 1e-3
"""Governed, friction configured as it is, peak slip in the loop: a disc carries force with torque up to 6.4 % less than
the ellipsoid that the governor counts on, so that it may slip before it has learnt."""

MINUTES: Final = 800
"""[s]: thousands of steps of 10 ms each, on a machine that is not idle. What takes longer than the others is `long`."""
RHO_M: Final = 0.03
DURATION_S: Final = 3.0  # the path takes 2 s, governed 2.4 s; the object spins on until 2.8 s
HAND = np.zeros(3), np.eye(3)
LOADS: Final = {
    "force_x": (0.0, 0.0),
    "force_y": (0.0, 90.0),
    "torque": (90.0, 0.0),
    "30": (30.0, 0.0),
    "60": (60.0, 0.0),
}
"""Degrees from force towards torque in the scaled plane, and of the force on the pads."""


def scenario(law, *assignments):
    """`paper_planar` with Coulomb friction."""
    coulomb = ("bridge.friction.model=coulomb", "bridge.friction.mu_s=0.4", f"bridge.duration_s={DURATION_S}")
    return load("paper_planar", law=law, set=(*coulomb, *assignments))


def wrench_of(params, name, share):
    """Wrench on the plate at the pads that uses this share of our limit surface; (6,) [N, N m]."""
    towards, on = np.radians(LOADS[name])
    size = share * params.friction.mu_k * params.grip.force
    force, torque = size * np.cos(towards), size * np.sin(towards) * params.friction.torsional_radius
    return np.array([force * np.cos(on), force * np.sin(on), 0.0, 0.0, 0.0, torque])


def scaled(params, three):
    """Motion x, y, turning as one number: turning counts times the torsional radius."""
    return float(np.hypot(np.hypot(three[0], three[1]), params.friction.torsional_radius * three[2]))


def recorded(scenario):
    """Poses of the hand [m] {w} and slip (x, y, angle) [m, rad] {p} at every tick of a run of ours."""
    hands, slips = [], []
    for tick in run_in_process(scenario):
        for incident in tick.incidents:
            print(f"\n{incident}")
        (arm,) = tick.outputs.arms
        truth = arm.readings.truth
        hands.append((truth.pad_position, truth.pad_rotation))
        slips.append(truth.slip_displacement[[0, 1, 5]])
    return hands, np.array(slips)


def carried(scenario, hands):
    """Slip (x, y, angle) [m, rad] {p} of Drake's plate in a hand that moves along these poses."""
    world = DrakePlant(scenario.bridge)
    world.take(hands[0], scenario.bridge.grip.force)
    slips = [world.slip()]
    for here, there in itertools.pairwise(hands):
        world.follow(here, there, scenario.bridge.grip.force)
        slips.append(world.slip())
    return np.array(slips)


@pytest.mark.parametrize("name", ["force_x", pytest.param("force_y", marks=pytest.mark.long), "torque"])
def test_creep_below_the_limit(name):
    params = scenario("classical").bridge
    world = DrakePlant(params)
    world.push([wrench_of(params, name, 0.9)])
    for _ in range(1000):
        world.follow(HAND, HAND, params.grip.force)
    start = world.slip()
    for _ in range(1000):
        world.follow(HAND, HAND, params.grip.force)
    creep = scaled(params, world.slip() - start)
    print(f"creep, {name}: {1e6 * creep:.3f} um/s")
    assert creep < CREEP_M_S


@pytest.mark.parametrize("name", LOADS)
def test_break_away_is_on_our_limit_surface(name):
    params = scenario("classical").bridge
    world = DrakePlant(params)
    for k in range(2000):
        share = 0.8 + 0.4 * k / 2000
        world.push([wrench_of(params, name, share)])
        world.follow(HAND, HAND, params.grip.force)
        if k > 50 and scaled(params, world.slip_rate()) > 5 * CREEP_M_S:
            break
    print(f"break-away, {name}: {share:.3f} of our limit")
    assert share == pytest.approx(1.0, abs=BREAK_AWAY)


@pytest.mark.timeout(MINUTES)
def test_slip_path_of_the_classical_law():
    run = scenario("classical")
    hands, ours = recorded(run)
    theirs = carried(run, hands)
    far, turned = np.hypot(ours[:, 0], ours[:, 1]), np.abs(ours[:, 2])
    off = theirs - ours
    apart, angle_apart = np.hypot(off[:, 0], off[:, 1]), np.abs(off[:, 2])
    for name, end, of in (("ours", ours[-1], far), ("Drake", theirs[-1], np.hypot(theirs[:, 0], theirs[:, 1]))):
        print(f"{name}: {1e3 * np.hypot(*end[:2]):.2f} mm, {np.degrees(end[2]):.2f} deg, peak {1e3 * of.max():.2f} mm")
    print(f"apart: {1e3 * apart.max():.2f} mm, {np.degrees(angle_apart.max()):.2f} deg")
    assert np.hypot(*theirs[-1, :2]) == pytest.approx(far[-1], rel=PATH)
    assert theirs[-1, 2] == pytest.approx(ours[-1, 2], rel=PATH)
    assert apart.max() < PATH * far.max()
    assert angle_apart.max() < PATH * turned.max()


@pytest.mark.long
@pytest.mark.timeout(MINUTES)
def test_governed_path_does_not_slip():
    run = scenario("governed", "controller.governor.friction_limit=0.18")
    hands, _ = recorded(run)
    theirs = carried(run, hands)
    peak = max(float(np.hypot(theirs[:, 0], theirs[:, 1]).max()), RHO_M * float(np.abs(theirs[:, 2]).max()))
    way = np.linalg.norm(hands[-1][0] - hands[0][0])
    print(f"governed: way {way:.3f} m, slip at most {1e3 * peak:.4f} mm")
    assert way > 0.49, "the path of 0.5 m is over"
    assert peak < GOVERNED_M


LOOPS: Final = {
    "classical": ("classical",),
    "vic": ("vic",),
    "vic, spin bounded": ("vic", "controller.gains.spin=bounded"),
    "governed": ("governed", "controller.governor.friction_limit=0.2"),
    "governed, friction 10 % low": ("governed", "controller.governor.friction_limit=0.18"),
}


ENGINES: Final = {"bridge": simulation.make_plant, "Drake": drake_plant}


@functools.cache
def loop(name, engine):
    """Hand and slip, as of `recorded`, of our controller against one of the engines."""
    run = scenario(*LOOPS[name])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(simulation, "make_plant", ENGINES[engine])
        hands, slips = recorded(run)
    far, turned = np.hypot(slips[:, 0], slips[:, 1]), np.abs(slips[:, 2])
    print(
        f"\n{name}, {engine}: slip at the end {1e3 * far[-1]:.4f} mm, {np.degrees(slips[-1, 2]):.3f} deg, "
        f"peak {1e3 * far.max():.4f} mm, {np.degrees(turned.max()):.3f} deg"
    )
    return hands, slips, max(far.max(), RHO_M * turned.max())


SPINS: Final = pytest.mark.xfail(
    strict=True,
    reason="the printed law follows the object's spin, wherever it goes: in Drake it ends in FAULT at 2.83 s; so it "
    "does in the bridge, at 3.25 s, and at 2.87 s with a torque of 5 % of the limit on the object (docs/fidelity.md)",
)


@pytest.mark.long
@pytest.mark.timeout(MINUTES)
@pytest.mark.parametrize("name", [pytest.param(name, marks=SPINS if name == "vic" else ()) for name in LOOPS])
def test_whole_loop(name):
    hands, slips, peak = loop(name, "bridge")
    their_hands, their_slips, their_peak = loop(name, "Drake")
    apart = max(np.linalg.norm(ours[0] - theirs[0]) for ours, theirs in zip(hands, their_hands, strict=True))
    print(f"{name}: hands at most {1e3 * apart:.3f} mm apart")
    ours, theirs = slips[-1], their_slips[-1]
    if name == "classical":
        assert np.hypot(*theirs[:2]) == pytest.approx(np.hypot(*ours[:2]), rel=PATH)
        assert theirs[2] == pytest.approx(ours[2], rel=PATH)
    elif name.startswith("vic"):
        share, metres = LOOP_VIC
        assert their_peak < share * loop("classical", "Drake")[2]
        assert their_peak == pytest.approx(peak, abs=metres)
    else:
        assert their_peak < (LOOP_GOVERNED_M if name == "governed" else GOVERNED_M)
