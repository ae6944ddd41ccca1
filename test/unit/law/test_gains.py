"""Gains and payload that change at run time: no kick, stable on the way, exact at both ends."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from slip_core.errors import InputError
from slip_core.params import build
from slip_core.records import dtype_of, new, record
from slip_vic.scenarios.scenario import load
from slip_vic_controller.law.bounds import slip_gain_limit
from slip_vic_controller.law.gains import (
    LAW_GAINS,
    UNKNOWN_LAG,
    Gains,
    Ramp,
    adapt,
    fill_ramp,
    gain_report,
    gains_at,
    make_law_gains,
    slow_down,
)
from slip_vic_controller.params.controller_params import ControllerParams
from test.support.call import blank, call

MS = 1_000_000


def gains_now(ramp: np.ndarray, stamp_ns: int) -> Any:
    """Return the gains in effect."""
    out = new(LAW_GAINS)
    call(gains_at, ramp, stamp_ns, out)
    return record(out, LAW_GAINS)


def ramp_between(start: np.ndarray, target: np.ndarray, begin_ns: int, least_ns: int) -> np.ndarray:
    """Return the RAMP between two LAW_GAINS."""
    ramp = new(dtype_of(Ramp))
    call(fill_ramp, ramp, start, target, begin_ns, least_ns)
    return ramp


STIFF = {"gains.stiffness": (20.0,) * 6, "gains.damping": (5.0,) * 6}


def law_gains(**values: Any) -> np.ndarray:
    params = build(ControllerParams, {name.replace("__", "."): value for name, value in values.items()}, "test")
    return make_law_gains(params, gain_report(params).used)


def random_gains(rng: np.random.Generator) -> dict[str, Any]:
    return {
        "gains.stiffness": tuple(10.0 ** rng.uniform(0.0, 2.0, 6)),
        "gains.damping": tuple(10.0 ** rng.uniform(0.5, 1.5, 6)),
        "gains.inertia": tuple(10.0 ** rng.uniform(-0.5, 0.5, 6)),
        "gains.k_s": float(rng.uniform(10.0, 1000.0)),
        "object.mass": float(rng.uniform(0.2, 2.0)),
    }


def test_parameters_become_gains() -> None:
    gains = record(law_gains(), LAW_GAINS)
    assert (gains.gains.K_D == [5.0] * 3 + [4.5] * 3).all()
    assert gains.gains.characteristic_length == 1.0
    assert gains.gains.spin_limit == math.inf
    assert gains.object.mass == 0.5
    assert (gains.contact_position == [0.02, 0.0, 0.0]).all()
    fading = {"gains__gamma_kp": 3.0, "gains__gamma_ko": 4.0, "gains__gamma_dp": 5.0, "gains__gamma_do": 6.0}
    faded = record(law_gains(gains__spin="follow", gains__alpha=7.0, **fading), LAW_GAINS).gains
    assert faded.gamma_k.tolist() == [3.0] * 3 + [4.0] * 3
    assert faded.gamma_d.tolist() == [5.0] * 3 + [6.0] * 3
    assert faded.alpha == 7.0
    classical = record(law_gains(controller="classical"), LAW_GAINS).gains
    assert classical.alpha == 0.0
    assert not classical.gamma_k.any()
    assert not classical.gamma_d.any()
    bounded = record(law_gains(gains__spin="bounded"), LAW_GAINS).gains
    assert bounded.characteristic_length == 0.03
    assert bounded.spin_limit == pytest.approx(0.05 * 4.5 / 0.3)
    assert not bounded.gamma_k[3:].any()
    with pytest.raises(InputError, match="inertia"):
        law_gains(object__inertia=(1.0, 1.0, 5.0, 0.0, 0.0, 0.0))


@pytest.mark.parametrize("seed", range(3))
def test_the_lyapunov_function_never_grows_on_a_ramp(seed: int) -> None:
    """V of the module along the exact response of every axis, with the gains that the ramp gives at every step."""
    rng = np.random.default_rng(seed)
    start, target = law_gains(**random_gains(rng)), law_gains(**random_gains(rng))
    ramp = ramp_between(start, target, 0, MS)
    ends = [record(one, LAW_GAINS).gains for one in (start, target)]
    a = 0.5 * np.minimum(*(g.D_D / g.M_D for g in ends))
    e, e_dot = rng.normal(size=6), rng.normal(size=6)
    steps = 500
    dt = 1e-9 * record(ramp, dtype_of(Ramp)).duration_ns / steps
    largest_rate = max(np.sqrt((g.K_D / g.M_D).max()) + (g.D_D / g.M_D).max() for g in ends)
    inner = max(1, min(200, int(np.ceil(dt * largest_rate / 0.05))))
    last = None
    for k in range(steps):
        gains = gains_now(ramp, round(k * dt * 1e9)).gains
        stiffness, damping = gains.K_D / gains.M_D, gains.D_D / gains.M_D
        V = 0.5 * (e_dot + a * e) ** 2 + 0.5 * (stiffness + a * damping - a * a) * e * e
        assert last is None or (last * (1.0 + 1e-3 * inner) + 1e-300 >= V).all()
        last = V
        for _ in range(inner):
            e_dot = e_dot + dt / inner * (-damping * e_dot - stiffness * e)
            e = e + dt / inner * e_dot


def test_half_way_every_number_is_between_its_ends() -> None:
    faded = {f"gains__gamma_{name}": 9.0 for name in ("kp", "ko", "dp", "do")}
    held = {"object__inertia": (9e-4, 9e-4, 9e-4, 1e-5, 1e-5, 1e-5), "contacts__position": (0.03, 0.01, 0.01)}
    start, target = (
        law_gains(),
        law_gains(**STIFF, **faded, **held, object__mass=0.8, gains__alpha=7.0, gains__k_s=99.0),
    )
    ramp, half = ramp_between(start, target, 0, 200 * MS), new(LAW_GAINS)
    call(gains_at, ramp, record(ramp, dtype_of(Ramp)).duration_ns // 2, half)
    changed = np.isfinite(start) & (start != target)
    assert changed.sum() == 12 + 4 * 3 + 1 + 9 + 3 + 2
    assert (np.minimum(start, target) < half)[changed].all()
    assert (half < np.maximum(start, target))[changed].all()


def test_ramps_have_exact_ends() -> None:
    start, target = law_gains(), law_gains(**STIFF, object__mass=0.8, gains__spin="bounded")
    ramp = ramp_between(start, target, 5 * MS, 200 * MS)
    duration = record(ramp, dtype_of(Ramp)).duration_ns
    for stamp, end in ((0, start), (5 * MS, start), (5 * MS + duration, target), (9 * MS + duration, target)):
        assert gains_now(ramp, stamp).tobytes() == end.tobytes()
    middle = gains_now(ramp, 5 * MS + duration // 2)
    assert middle.gains.K_D[0] == pytest.approx(math.sqrt(5.0 * 20.0), rel=1e-6)
    assert middle.object.mass == pytest.approx(math.sqrt(0.5 * 0.8), rel=1e-6)
    assert middle.gains.characteristic_length == pytest.approx(0.5 * 1.03, rel=1e-6)
    assert middle.gains.spin_limit == record(target, LAW_GAINS).gains.spin_limit


def test_stiffening_takes_longer_than_softening() -> None:
    soft, hard = law_gains(), law_gains(**STIFF)
    assert record(ramp_between(soft, hard, 0, 200 * MS), dtype_of(Ramp)).duration_ns > 300 * MS
    assert record(ramp_between(hard, soft, 0, 200 * MS), dtype_of(Ramp)).duration_ns == 200 * MS


def test_slowing_down_keeps_the_damping_ratio() -> None:
    gains = record(new(LAW_GAINS), LAW_GAINS).gains
    gains.M_D[:], gains.K_D[:] = (1.0, 2.0, 4.0, 0.1, 0.2, 0.4), (400.0, 300.0, 200.0, 10.0, 20.0, 30.0)
    gains.D_D[:] = (40.0, 50.0, 60.0, 2.0, 3.0, 9.0)  # 40, 25, 15, 20, 15, 22.5 1/s
    ratio, before = gains.D_D / np.sqrt(gains.K_D * gains.M_D), gains.D_D.copy()
    call(slow_down, gains, 20.0)
    np.testing.assert_allclose(gains.D_D / gains.M_D, (20.0, 20.0, 15.0, 20.0, 15.0, 20.0))
    np.testing.assert_allclose(gains.D_D / np.sqrt(gains.K_D * gains.M_D), ratio)
    assert gains.D_D[[2, 3, 4]].tolist() == before[[2, 3, 4]].tolist()


def test_the_loop_of_an_estimated_arm_has_a_least_delay() -> None:
    """Efforts act four control periods late where less is configured; what is configured beyond that counts."""

    def k_s(**values: Any) -> float:
        given = {name.replace("__", "."): value for name, value in values.items()}
        return gain_report(build(ControllerParams, {"tare.duration_s": 0.3} | given, "test")).used

    late = {"drive__delay_s": 0.004}
    assert k_s() == k_s(**late) == k_s(**late, controller="printed") < k_s(controller="printed")
    assert k_s(drive__delay_s=0.006) < k_s()


def test_unknown_lag_bounds_k_s() -> None:
    params = load("paper_planar", law="vic", drive="velocity_125", sensor="ideal").controller
    accepted = gain_report(params).accepted
    assert accepted == pytest.approx(slip_gain_limit(1e-3, latency_s=UNKNOWN_LAG * params.drive_lag_s) / 2.0)
    assert gain_report(params.model_copy(update={"slip_estimator": "measured"})).accepted < 0.5 * accepted


@pytest.mark.parametrize(
    ("classical", "excursion", "fades", "length", "spin"),
    [
        (False, math.inf, [1.0] * 6, 1.0, math.inf), (False, 0.1, [1.0] * 3 + [0.0] * 3, 2.0, 0.4),
        (True, 0.1, [0.0] * 6, 2.0, 0.4),
    ],
)  # fmt: skip
def test_gains_of_each_kind_of_law(
    classical: bool, excursion: float, fades: list[float], length: float, spin: float
) -> None:
    gains = blank(Gains)
    gains.K_D[:], gains.M_D[:], gains.gamma_k[:], gains.gamma_d[:] = [1.0, 1.0, 1.0, 2.0, 12.0, 8.0], 2.0, 1.0, 1.0
    gains.alpha, gains.k_s, gains.characteristic_length = 50.0, 9.0, 2.0
    call(adapt, gains, classical, excursion, np.array([1.0, 1.0, 0.0, 0.0, 1.0, 1.0]), 7.0)
    assert gains.gamma_k.tolist() == gains.gamma_d.tolist() == fades
    assert (gains.alpha, gains.k_s, gains.characteristic_length) == (0.0 if classical else 50.0, 7.0, length)
    assert gains.spin_limit == pytest.approx(spin)
