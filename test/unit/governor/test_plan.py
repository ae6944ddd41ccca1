"""The plan: backward pass against a conic solver, path parameter against quadrature."""

from decimal import Decimal
from types import SimpleNamespace

import numpy as np
import pytest

from slip_vic_controller.governor.layouts import PATH_MARGIN
from slip_vic_controller.governor.plan import GridPoint, admissible, larger_root, most, path_time
from test.referees.governor_bench import PAPER, PAPER_PLANAR, VERTICAL, Governing, Governor
from test.referees.governor_paths import BentPath
from test.support.call import blank, call

SOLVER = 1e-3
"""Relative: what interior point solvers reach on 200 chained cones."""
SEED = 11
LIGHT = SimpleNamespace(**{**vars(PAPER_PLANAR), "gravity": np.array([0.1, -0.1, 0.2]), "axes": np.ones(6)})
"""All six axes, and a weight that friction carries in every attitude."""


def bent(rng, case):
    start = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    start *= np.linalg.det(start)
    return BentPath(rng.normal(size=6) * 0.3, rng.uniform(0.8, 2.0), rng.normal(size=6) * 0.05, start)


def vectors(G):
    """l_u, l_x, l_c at the points: from differences of the load, which is affine."""
    rows = []
    for point in G.points:
        _, R, v, a = G.path.at(float(point["time"]))
        g = float(point["speed"])
        bend = float(point["bend"])
        tangent, curve = v / g, (a - v * bend / g) / g**2
        zero = np.zeros(6)
        l_c = G.load_of(R, zero[:3], zero)
        rows.append((G.load_of(R, zero[:3], tangent) - l_c, G.load_of(R, tangent[3:], curve) - l_c, l_c))
    return np.array(rows).transpose(1, 0, 2)


def test_points_keep_load_products() -> None:
    rng = np.random.default_rng(SEED)
    for mode in (Governing.SLOW_DOWN, Governing.TIME_OPTIMAL):
        G = Governor(bent(rng, PAPER_PLANAR), PAPER_PLANAR, mode=mode)
        l_u, l_x, l_c = vectors(G)
        for name, a, b in (("uu", l_u, l_u), ("ux", l_u, l_x), ("xx", l_x, l_x), ("xc", l_x, l_c), ("cc", l_c, l_c)):
            ours, theirs = G.points[name][1:-1], (a * b).sum(1)[1:-1]
            np.testing.assert_allclose(ours, theirs, rtol=1e-6, atol=1e-6 * np.abs(theirs).max())


def test_heaviest_place_is_found() -> None:
    rng, inside = np.random.default_rng(SEED), 0
    for _ in range(6):
        G = Governor(bent(rng, LIGHT), LIGHT, margin=1.0).plan()
        worst = int(np.argmax(G.points["cc"]))
        inside += 0 < worst < len(G.points) - 1
        assert G.state.weight_load == np.sqrt(G.points["cc"][worst])
        assert G.state.heaviest_time == G.points["time"][worst]
    assert inside


def test_s_is_path_length() -> None:
    rng = np.random.default_rng(SEED)
    path = bent(rng, PAPER_PLANAR)
    G = Governor(path, PAPER_PLANAR, mode=Governing.TIME_OPTIMAL)
    t = np.linspace(G.points["time"][0], G.points["time"][-1], 10_001)
    speeds = []
    for time in t:
        v, share = path.at(time)[2], 4 * (time / path.duration) * (1 - time / path.duration)
        speeds.append(np.sqrt(v[:3] @ v[:3] + 0.01 * v[3:] @ v[3:] + (0.05 * share**2) ** 2))
    length = np.concatenate(([0.0], np.cumsum(0.5 * (t[1] - t[0]) * (np.array(speeds[1:]) + speeds[:-1]))))
    np.testing.assert_allclose(G.points["s"], np.interp(G.points["time"], t, length), atol=2e-6 * length[-1])
    for s in rng.uniform(0, length[-1], 200):
        assert abs(path_time(G.points, s) - np.interp(s, length, t)) < 1e-4 * path.duration


LAST = 190
"""The cells after it are too small for a solver's tolerance; K of this point is taken as known."""


def conic_bound(cp, G, first):
    """K of a point as its definition says: the largest x there from which the rest can be run."""
    p = G.points
    l_u, l_x, l_c = (v[first : LAST + 1] for v in vectors(G))
    D, F = np.diff(p["s"][first : LAST + 1]), float(PATH_MARGIN * G.state.plan_load)
    n, way, pace = len(l_u), D.mean(), p["K"][first:LAST].max()
    x, u = cp.Variable(n, nonneg=True), cp.Variable(n)  # x over pace, u over pace / way
    load = cp.multiply(l_u * pace / way / F, u[:, None]) + cp.multiply(l_x * pace / F, x[:, None]) + l_c / F
    rules = [cp.norm(load[: n - 1], axis=1) <= 1, x[1:] == x[:-1] + cp.multiply(2 * D / way, u[: n - 1])]
    rules += [x <= np.minimum(p["cap"][first : LAST + 1] / pace, 1e3), x[n - 1] <= p["K"][LAST] / pace]
    cp.Problem(cp.Maximize(x[0]), rules).solve(solver=cp.CLARABEL)
    return float(x.value[0]) * pace


def test_bound_matches_conic_solver() -> None:
    cp = pytest.importorskip("cvxpy", reason="a referee of requirements-test.lock")
    rng = np.random.default_rng(SEED)
    for case, path in (
        (PAPER, BentPath(PAPER.way, PAPER.duration)), (VERTICAL, BentPath(VERTICAL.way, VERTICAL.duration)),
        (LIGHT, bent(rng, LIGHT)),
    ):  # fmt: skip
        for mode in (Governing.SLOW_DOWN, Governing.TIME_OPTIMAL):
            G = Governor(path, case, mode=mode, margin=1.0).plan()
            for first in (20, 100, 150):
                ours = float(G.points["K"][first])
                assert ours == pytest.approx(conic_bound(cp, G, first), rel=SOLVER)


def point_of(l_u, l_x, l_c, cap):
    point = blank(GridPoint)
    point.uu, point.ux, point.uc = l_u @ l_u, l_u @ l_x, l_u @ l_c
    point.xx, point.xc, point.cc = l_x @ l_x, l_x @ l_c, l_c @ l_c
    point.cap = cap
    return point


def test_bound_admissible_near_weight() -> None:
    rng, bounds = np.random.default_rng(SEED), []
    for _ in range(500):
        l_u, l_x, l_c = (rng.normal(size=3) * 10.0 ** rng.uniform(-2.0, 2.0) for _ in range(3))
        F, way, after = 10.0 ** rng.uniform((-1.0, -4.0, -6.0), (1.0, 0.0, 2.0))
        l_c *= F * (1.0 - 10.0 ** rng.uniform(-14.0, -10.0)) / np.linalg.norm(l_c)
        point = point_of(l_u, l_x, l_c, 10.0 ** rng.uniform(-2.0, 2.0))
        bounds.append(most(point, F, way, after))
        assert admissible(point, bounds[-1], F, 2.0 * way, after)
    assert min(bounds) < 1e-6 < max(bounds)


def a_point(rng):
    """A point of a path with some load, and l_u, l_x, l_c; the weight takes a part of F = 1 N."""
    l_u, l_x, l_c = (rng.normal(size=3) * 10.0 ** rng.uniform(-1.0, 1.0) for _ in range(3))
    l_c *= rng.uniform(0.1, 0.95) / np.linalg.norm(l_c)
    return point_of(l_u, l_x, l_c, 1e6), l_u, l_x, l_c


def test_bound_is_largest_admissible() -> None:
    rng, inside = np.random.default_rng(SEED), 0
    for _ in range(100):
        point = a_point(rng)[0]
        way, after = 10.0 ** rng.uniform((-2.0, -2.0), (1.0, 0.5))
        bound = most(point, 1.0, way, after)
        assert admissible(point, bound, 1.0, 2.0 * way, after)
        inside += bound < point.cap
        for more in (1e-6, 1e-3, 0.1):
            assert bound == point.cap or not admissible(point, bound * (1.0 + more), 1.0, 2.0 * way, after)
    assert inside > 80


def test_too_heavy_path_is_refused() -> None:
    path = BentPath(VERTICAL.way, VERTICAL.duration)
    G = Governor(path, VERTICAL, margin=0.95).plan()
    assert G.state.infeasible == 1
    assert G.state.weight_load / VERTICAL.force == pytest.approx(0.958, abs=1e-3)
    assert G.state.heaviest_time == path.duration
    assert Governor(path, VERTICAL, margin=1.0).plan().state.infeasible == 0


def test_larger_root_matches_numpy() -> None:
    rng = np.random.default_rng(SEED)
    for a, b, c in rng.normal(size=(300, 3)):
        roots = np.roots((abs(a), 2.0 * b, c))
        expected = roots.real.max() if np.isreal(roots).all() else -1.0
        assert call(larger_root, abs(a), b, c) == pytest.approx(expected)
    for a in (0.0, -1.0):
        assert call(larger_root, a, 1.0, -1.0) == -1.0


def test_small_root_keeps_digits() -> None:
    """x = -c / (b + root): the other form of it is a difference of nearly equal numbers there."""
    for b in (0.5, 2.0):
        for c in (-1e-3, -1e-8, -1e-12):
            exact = (Decimal(b) ** 2 - Decimal(c)).sqrt() - Decimal(b)  # 28 digits
            assert call(larger_root, 1.0, b, c) == pytest.approx(float(exact), rel=1e-14, abs=0.0)
