"""The governor on a path, with a hand that follows its reference."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from slip_vic_controller.governor import governor
from slip_vic_controller.governor.guard import BRAKES
from slip_vic_controller.governor.layouts import Governor as State
from slip_vic_controller.governor.plan import path_time
from slip_vic_controller.governor.step import OVER, Limit
from test.referees.governor_bench import PAPER, PAPER_PLANAR, VERTICAL, Friction, Governing, Governor, scene
from test.referees.governor_paths import BentPath
from test.support.call import call, left

ROUNDING = 1e-9
DT = 1e-3
RESERVE = 0.5
BETWEEN_POINTS = 0.02
"""Share that braking between the points of the grid takes of the reserve."""


def travel(G, most=6000, disturbance=None, seed=0):
    """Run without a hand: it follows its reference; return loads over the guard's limit, and the cycles it takes."""
    rng, over = np.random.default_rng(seed), 0.0
    for k in range(most):
        _, R, v, a = G.before()
        extra = np.zeros(6) if disturbance is None else disturbance * rng.normal(size=6)
        G.after(a + extra, a, R, v[3:])
        over = max(over, float(G.pad.commanded / G.state.ceiling))
        if G.state.arrived:
            return over, k
    return over, most


def on_its_way(cycles):
    """Return a governor of the paper's path after so many cycles without a hand, with R, v and a of the last one."""
    G = Governor(BentPath(PAPER.way, 2.0), PAPER).plan()
    for _ in range(cycles):
        _, R, v, a = G.before()
        G.after(a, a, R, v[3:])
    return G, R, v, a


@pytest.mark.parametrize(("case", "margin"), [(PAPER, 0.95), (VERTICAL, 1.0)])
@pytest.mark.parametrize("mode", [Governing.SLOW_DOWN, Governing.TIME_OPTIMAL])
def test_path_leaves_reserve(case, margin, mode) -> None:
    G = Governor(BentPath(case.way, case.duration), case, margin=margin, reserve=RESERVE, mode=mode).plan()
    most = 0.0
    while G.state.arrived == 0:
        _, R, v, a = G.before()
        G.after(a, a, R, v[3:])
        weight = np.linalg.norm(G.load_of(R, np.zeros(3), np.zeros(6)))
        load = np.linalg.norm(G.load_of(R, v[3:], a))
        most = max(most, float((load - weight) / (G.state.usable - weight)))
    assert 0.95 * (1 - RESERVE) < most < 1 - RESERVE + BETWEEN_POINTS


def test_reference_follows_slipping_pad() -> None:
    G = Governor(BentPath(PAPER.way, PAPER.duration), PAPER).plan()
    while G.state.s < 0.4 * G.state.end:
        G.before()
    G.state.contact.slipping = 1
    s, slower = float(G.state.s), 0.7 * float(G.state.rate)
    assert slower > 0.01
    for rate in (slower, -slower):
        for _ in range(20):
            s += rate * G.dt
            time = path_time(G.points, s)
            x, R, v, _ = G.path.at(time)
            G.before(x, R, rate * v / np.interp(time, G.points["time"], G.points["speed"]))
            assert G.state.rate == pytest.approx(max(rate, 0.0), rel=0.02, abs=1e-9)
            assert G.state.s == pytest.approx(s, abs=2.0 * G.dt * slower)


def test_endless_slip_is_left_behind() -> None:
    """Pads that tremble with the joints slip permanently."""
    G = Governor(BentPath(PAPER.way, PAPER.duration), PAPER).plan()
    still, cycles = np.zeros(6), round(governor.LED_S / DT)

    def pass_time(n: int, slipping: int) -> float:
        G.state.contact.slipping = slipping
        for _ in range(n):
            G.before(v=still if slipping and not G.state.endless else None)
        return float(G.state.rate)

    assert pass_time(cycles - 10, 1) == 0.0
    assert pass_time(300, 1) > 0.1, "the pad follows again, although it still slips"
    assert G.state.endless == 1
    pass_time(cycles - 10, 0)
    assert G.state.endless == 1
    pass_time(20, 0)
    assert (G.state.endless, G.state.led_s) == (0, 0.0)
    G.state.endless, G.state.led_s, G.state.arrived = 1, 1.0, 1
    pass_time(1, 1)
    assert (G.state.endless, G.state.led_s) == (0, 0.0), "at its goal nothing waits"
    G.state.arrived, G.config.led = 0, 0
    pass_time(cycles + 10, 1)
    assert G.state.endless == 0, "several arms keep to their path"


@pytest.mark.parametrize(("share", "cycles"), [(0.8, 200), (1.5, 300)])
def test_lasting_slip_leaves_time_to_brake(share: float, cycles: int) -> None:
    G, *_ = on_its_way(1000)
    G.state.contact.slipping, rate = 1, float(G.state.rate)
    G.points["K"][:] = share * rate**2 / OVER
    done = 0
    while G.state.endless == 0 and done < 300:
        G.before(v=1.02 * rate * G.path.at(float(G.state.time))[2])
        done += 1
    assert abs(done - cycles) <= 1
    led = float(G.state.rate)
    _, _, _, a = G.before(v=1.02 * rate * G.path.at(float(G.state.time))[2])
    assert G.state.endless == (share < 1.0)
    assert (G.state.rate < led and np.any(a != 0.0)) == (share < 1.0), "while it leads, a_d is 0"


def test_several_arms_keep_path() -> None:
    """Each without the path's acceleration, they pull the object apart and do not brake for the end."""
    sticks, slips = (Governor(BentPath(PAPER.way, PAPER.duration), PAPER).plan() for _ in range(2))
    slips.config.led = 0
    for G in (sticks, slips):
        while G.state.s < 0.4 * G.state.end:
            G.before()
    slips.state.contact.slipping = 1
    for _ in range(200):
        for kept, followed in zip(sticks.before(), slips.before(), strict=True):
            np.testing.assert_array_equal(followed, kept)


def test_late_sample_uses_its_stamp() -> None:
    G = Governor(BentPath(PAPER.way, 2.0), PAPER)
    for k in range(200):
        G.pad.commanded = 0.1 + 0.0005 * k
        G.record_load(np.array([0.11 + 0.0005 * k, 0, 0, 0, 0, 0.0]), k * 1_000_000)
    assert G.slip(120_500_000, 1e-3)
    assert abs(G.pad.contact.F_median - 0.95 * 0.16) < 1e-12


@pytest.mark.parametrize("share", [0.9, 0.994, 0.996, 1.004, 1.006])
def test_changed_friction_replans_at_once(share: float) -> None:
    G, R, v, a = on_its_way(900)
    before = float(G.state.plan_load)
    G.state.contact.F_lo = G.state.contact.F_median = share * PAPER.force
    _, R, v, a = G.before()
    G.after(a, a, R, v[3:])
    changed = abs(share - 1.0) > governor.REPLAN
    assert G.state.plan_load == pytest.approx(share * before if changed else before, rel=1e-12)
    assert G.state.rate**2 <= np.interp(G.state.s, G.points["s"], G.points["K"]) * (1 + ROUNDING)
    assert G.pad.commanded <= share * PAPER.force * (1 + ROUNDING)


@pytest.mark.parametrize("slipped_at", [0.18, 0.25])
def test_least_stopping_load_is_planned(slipped_at: float) -> None:
    """Margin is given up up to 0.985 of the load at which it slipped; where that is not enough, none is."""
    G, *_ = on_its_way(1100)
    state, contact, rate2 = G.state, G.state.contact, float(G.state.rate) ** 2
    contact.F_lo, contact.F_median, contact.slipped_at = 0.14, 0.14, slipped_at
    least = next(
        F for F in np.linspace(0.133, 0.985 * 0.25, 300) if call(governor.stops_with, G.config, state, G.points, F, 0.0)
    )
    G.plan()
    assert state.asked == pytest.approx(0.95 * 0.14)
    bound = np.interp(state.s, G.points["s"], G.points["K"])
    if slipped_at == 0.25:
        assert least - 1e-3 < state.plan_load < least * (1 + 2 * governor.REPLAN)
        assert rate2 <= bound
    else:
        assert (state.plan_load, rate2 > bound) == (state.asked, True)


def test_braking_keeps_limit() -> None:
    G, R, v, a = on_its_way(900)
    G.state.contact.F_lo = G.state.contact.F_median = 0.8 * PAPER.force
    G.state.asked = call(governor.load_to_plan, G.config, G.state, G.points)
    G.points["K"][:] = 1e-6  # as if that plan were there, and nowhere admitted motion
    before = float(G.state.rate)
    assert before > 0.1
    _, R, v, a = G.before()
    assert 0.0 < G.state.rate < before
    assert np.linalg.norm(G.load_of(R, v[3:], a)) <= float(G.state.usable) * (1 + ROUNDING)


def test_first_unmet_limit_is_published() -> None:
    G, *_ = on_its_way(900)
    assert G.state.limit == Limit.NONE
    G.before(most_rate=0.0)
    assert G.state.limit == Limit.SPEED, "it brakes as hard as the load admits"
    G.pad.feedback[0] = 10.0
    G.before(most_rate=0.0)
    assert G.state.limit == Limit.LOAD, "the feedback alone loads more than friction carries"


def test_catching_up_uses_carried_load() -> None:
    """Else the restart is the first to ask for all that is told of friction, where the path never does."""
    G, *_ = on_its_way(1000)
    while G.state.rate > 0.0:
        G.before(most_rate=0.0)
    G.state.contact.carried = carried = 0.1
    most = 0.0
    for _ in range(6000):
        _, R, v, a = G.path.at(float(G.state.time))
        planned = np.linalg.norm(G.load_of(R, float(G.state.rate) * v[3:], a))
        _, R, v, a = G.before()
        asked = np.linalg.norm(G.load_of(R, v[3:], a))
        assert G.state.out_u <= 0.0 or asked <= 1.01 * max(carried + G.config.friction.probe, planned)
        most = max(most, asked)
    assert G.state.arrived == 1
    assert most > carried


SUCKED = {"bluenb": (0.551, 4.38), "westone": (0.204, 5.40), "kindlebox": (0.210, 5.38), "carton": (0.347, 4.98)}
"""Mass [kg] and friction [N] of 20 N suction from above at 0.3 (H. Pham and Q.-C. Pham, rapid-transport exp2, 2019)."""
CARRIED = {"bottle": 0.26, "cup": 0.28, "die": 0.54, "block": 0.30, "box": 0.2}
"""Friction coefficients of objects on a level tray (A. Heins and A. P. Schoellig, upright, 2023)."""


@pytest.mark.parametrize(
    ("mass", "force", "way"),
    [(*of, 0.784) for of in SUCKED.values()] + [(1.0, 9.81 * mu, 2.236) for mu in CARRIED.values()],
    ids=[*SUCKED, *CARRIED],
)
def test_straight_paths_of_others_near_their_bounds(mass: float, force: float, way: float) -> None:
    """From rest to rest friction alone takes at least 2 sqrt(way m / F): full acceleration, then full braking."""
    case = scene(mass, 1e-3, (0.0, 0.0), force, 0.03, (0.0, 0.0), (way, 0.0, 0.0), 2.0)
    G = Governor(BentPath(case.way, case.duration), case, margin=1.0, mode=Governing.TIME_OPTIMAL).plan()
    over, cycles = travel(G)
    assert 1.0 <= cycles * DT / (2.0 * np.sqrt(way * mass / force)) < 1.15
    assert over <= 1.0 + ROUNDING


def test_even_bound_brakes_evenly() -> None:
    """Under K = c - g s the motion is sdot^2 = c - g s: sddot = -g / 2, whatever the period."""
    c, g = 0.9, 0.3
    strong = SimpleNamespace(**{**vars(PAPER), "force": 100.0})
    G = Governor(BentPath(PAPER.way, 2.0), strong, dt=4e-3).plan()
    G.points["K"][:] = c - g * G.points["s"]
    G.before()
    rate = float(G.state.rate)
    for k in range(1, 51):
        G.before()
        assert G.state.rate**2 == pytest.approx(c - g * G.state.s, rel=1e-12)
        assert G.state.rate == pytest.approx(rate - 0.5 * g * k * G.dt, rel=1e-12)


def test_moving_average_is_the_mean() -> None:
    G, H = (Governor(BentPath(PAPER.way, 2.0), PAPER, window=window).plan() for window in (1, 8))
    raw = []
    for _ in range(300):
        for g in (G, H):
            g.before()
        raw.append([float(G.state[name]) for name in ("out_s", "out_rate", "out_u")])
        if len(raw) >= 8:
            mean = np.mean(raw[-8:], axis=0)
            np.testing.assert_allclose([H.state.out_s, H.state.out_rate, H.state.out_u], mean, rtol=1e-9, atol=1e-12)


UNSHRUNK = (Phase.explicit, Phase.reuse, Phase.generate)
"""A case is a run of hundreds of cycles: made smaller, it would take minutes."""
SIX = st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=6)


@settings(max_examples=30, deadline=None, phases=UNSHRUNK)
@given(
    way=SIX, side=SIX, duration=st.floats(0.5, 3.0), force=st.floats(0.05, 2.0), margin=st.floats(0.5, 1.0),
    disturbance=st.floats(0.0, 5.0), mode=st.sampled_from([Governing.SLOW_DOWN, Governing.TIME_OPTIMAL]),
    tilt=st.floats(0.0, 0.3),
)  # fmt: skip
def test_load_stays_within_limit(way, side, duration, force, margin, disturbance, mode, tilt) -> None:
    case = SimpleNamespace(**{**vars(PAPER_PLANAR), "force": force, "gravity": np.array([0.05 * tilt, 0.0, -9.81])})
    path = BentPath(0.4 * np.array(way) * [1, 1, 0, 0, 0, 1], duration, 0.05 * np.array(side) * [1, 1, 0, 0, 0, 1])
    if np.linalg.norm(path.way) < 0.02:
        return
    G = Governor(path, case, mode=mode, margin=margin).plan()
    if G.state.infeasible:
        return
    over, _ = travel(G, 400, disturbance=disturbance)
    assert over <= 1 + ROUNDING


def test_limit_below_weight_continues() -> None:
    """The weight was carried at rest; a stop on the way would throw what hardly holds, and rest asks the weight too."""
    G = Governor(BentPath(VERTICAL.way, VERTICAL.duration), VERTICAL, margin=1.0).plan()
    for k in range(6000):
        _, R, v, a = G.before()
        G.after(a, a, R, v[3:])
        if k == 300:
            G.state.contact.F_lo = G.state.contact.F_median = 0.5 * VERTICAL.force
        assert G.state.infeasible == 0
        assert G.pad.commanded <= VERTICAL.force * (1 + ROUNDING)
        if G.state.arrived:
            break
    assert 800 < k < 5999


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_arm_brakes_beyond_learnt_friction(direction: float) -> None:
    """With a limit or a mass that is wrong by so much; without that it would drift on until a joint is too fast."""
    G = Governor(BentPath(VERTICAL.way, VERTICAL.duration), VERTICAL, margin=1.0).plan()
    R = G.before()[1]
    rest = np.linalg.norm(G.load_of(R, np.zeros(3), np.zeros(6)))
    a = direction * 5.0 * np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    G.state.ceiling = 0.5 * rest
    assert 0.1 < G.after(a, a, R, np.zeros(3)) <= 1.0
    assert G.pad.commanded <= BRAKES * rest * (1 + ROUNDING)


def test_unknown_friction_is_tried() -> None:
    """What carries the weight along the path can only be found by going there; no more than that is asked."""
    G = Governor(BentPath(VERTICAL.way, VERTICAL.duration), VERTICAL, margin=1.0, estimator=Friction.UNKNOWN).plan()
    over, cycles = travel(G)
    assert G.state.infeasible == 0
    assert cycles < 5999
    assert over <= 1 + ROUNDING


def test_a_discarded_plan_leaves_the_place_on_the_path() -> None:
    found = left(governor.discard_plan, Governor(BentPath(PAPER.way, 2.0), PAPER).config, State)
    kept = {"duration", "time", "end", "out_speed", "out_bend", "arrived", "usable", "ceiling", "ring", "contact"}
    assert set(found) == kept | {"s", "out_s", "out_time"}
    assert found["out_s"] == found["out_time"] == 1.0
