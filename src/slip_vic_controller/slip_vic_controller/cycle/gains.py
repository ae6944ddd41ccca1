"""The gains in effect in a cycle: their ramp, the mass that a tare has found, and what measured delays allow."""

from __future__ import annotations

from slip_core.compiled import part
from slip_vic_controller.law.bounds import held_sample_limit, internal_gain_limit
from slip_vic_controller.law.gains import gains_at
from slip_vic_controller.safety.latency import whole_cycles
from slip_vic_controller.state import ArmState, ControllerConfig, CycleOutputs


@part
def gains_now(state: ArmState, stamp_ns: int, outputs: CycleOutputs) -> None:
    """Write gains and payload in effect, with the mass that a tare has found; its inertia grows as much."""
    gains_at(state.law.ramp, stamp_ns, outputs.gains)
    measured = 1.0 + state.tare.mass_share
    outputs.gains.object.mass *= measured
    for i in range(3):
        for j in range(3):
            outputs.gains.object.inertia[i, j] *= measured


@part
def adapt_slip_gain(config: ControllerConfig, state: ArmState, outputs: CycleOutputs) -> None:
    """Lower k_s to what the measured delays allow."""
    held, late = whole_cycles(state.law.slip_latency, config.cycle.period_ns)
    if held != state.law.held or late != state.law.late:  # they seldom change
        state.law.held, state.law.late = held, late
        state.law.k_s_limit = held_sample_limit(held, late) / (1e-9 * config.cycle.period_ns) / config.cycle.k_s_margin
    outputs.gains.gains.k_s = min(outputs.gains.gains.k_s, state.law.k_s_limit)


@part
def limit_internal_gain(config: ControllerConfig, state: ArmState, outputs: CycleOutputs) -> None:
    """Lower kappa to what the measured delay from a wrench to its answer, and the drives' lag, allow."""
    gains, late_ns = outputs.gains.gains, 0
    for k in range(config.law.contacts):
        late_ns = max(late_ns, state.joint.answers.stamp_ns - state.wrench_inputs[k].stamp_ns)
    late_s = config.cycle.drive_lag_s + config.cycle.kappa_late_s
    delay_s = late_s + 1e-9 * (config.cycle.period_ns + state.latency.most_ns + late_ns)
    least = min(gains.M_D[0], gains.M_D[1], gains.M_D[2])
    most = internal_gain_limit(least, config.cycle.pad_stiffness, delay_s)
    gains.kappa = min(gains.kappa, config.cycle.kappa_share * most)
