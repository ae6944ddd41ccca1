"""Parameters of everything that stands between the law and the joints: limits, watchdogs, fallbacks."""

from __future__ import annotations

from pydantic import Field, model_validator

from slip_core.params import ParameterModel, parameter


class LimitParams(ParameterModel):
    """What no command exceeds, whatever mode it comes from; effort and velocity limits themselves are the URDF's."""

    effort_rate: float = parameter(1000.0, "largest change of a joint's effort", unit="N m/s", gt=0.0)
    longest_step_s: float = parameter(
        0.005, "time between two commands that the rate limit counts at most: a pause buys no jump", unit="s", gt=0.0
    )
    restart_after_s: float = parameter(
        0.05, "pause after which the rate limit starts again from the measured effort", unit="s", gt=0.0
    )
    position_margin: float = parameter(
        0.1, "distance from a joint's stop at which it is pushed back, growing to its full effort", unit="rad", gt=0.0
    )
    velocity_scale: float = parameter(1.0, "share of the URDF's velocity limits that is used", gt=0.0)
    velocity_brake: float = parameter(0.9, "share of that at which a joint is braked", gt=0.0, lt=1.0)
    velocity_trip: float = parameter(1.5, "share of that which is a fault", gt=1.0)
    speed_linear: float = parameter(
        3.0, "speed of the pad at which it is braked; a third above is a fault", unit="m/s", gt=0.0
    )
    speed_angular: float = parameter(
        10.0, "angular speed of the pad at which it is braked; a third above is a fault", unit="rad/s", gt=0.0
    )
    error_linear: float = parameter(
        0.3, "distance from the reference at which it stands still; it slows down from half of it", unit="m", gt=0.0
    )
    error_angular: float = parameter(6.0, "the same for the attitude error", unit="rad", gt=0.0)


class WatchParams(ParameterModel):
    """Limits of one input."""

    age_s: float = parameter(0.05, "age above which the newest sample does not count", unit="s", gt=0.0)
    frozen_s: float = parameter(
        0.1, "time for which values may stay equal to the last bit while the arm moves", unit="s", gt=0.0
    )


class WrenchWatchParams(WatchParams):
    """Limits of the wrench."""

    force: float = parameter(1000.0, "force above which a sample is absurd", unit="N", gt=0.0)
    torque: float = parameter(200.0, "torque above which a sample is absurd", unit="N m", gt=0.0)


class SlipWatchParams(WatchParams):
    """Limits of the slip velocity."""

    age_s: float = parameter(0.15, "age above which the newest sample does not count", unit="s", gt=0.0)
    linear: float = parameter(5.0, "linear slip speed above which a sample is absurd", unit="m/s", gt=0.0)
    angular: float = parameter(100.0, "angular slip speed above which a sample is absurd", unit="rad/s", gt=0.0)


class JointWatchParams(WatchParams):
    """Limits of the joint state; positions and velocities are judged against the URDF's limits."""

    late_s: float = parameter(
        0.0,
        "time from stamp to answer, above the least one, that is too late for the law; 0 = not looked at, because the "
        "stamps of a simulation fall behind where the machine is too slow for it",
        unit="s",
        ge=0.0,
    )
    position_slack: float = parameter(0.5, "how far beyond a stop a position is absurd", unit="rad", gt=0.0)
    velocity_factor: float = parameter(50.0, "multiple of the URDF's velocity limit that is absurd", gt=1.0)
    jump: float = parameter(
        0.05, "step of a position, beyond what twice the velocities explain, that is a jump", unit="rad", gt=0.0
    )


class InputParams(ParameterModel):
    """Plausibility of the inputs."""

    joint: JointWatchParams = Field(default_factory=JointWatchParams)
    wrench: WrenchWatchParams = Field(default_factory=WrenchWatchParams)
    slip: SlipWatchParams = Field(default_factory=SlipWatchParams)
    future_s: float = parameter(0.05, "how far a stamp may lie ahead of the joint state's", unit="s", gt=0.0)
    clock_jump_s: float = parameter(
        0.2,
        "step of the joint state's stamp, beyond the time that passed, that is a jump of the clock",
        unit="s",
        gt=0.0,
    )
    bridge_s: float = parameter(
        0.01, "gap of good joint states that is bridged by repeating the last effort", unit="s", ge=0.0
    )
    accept_after: int = parameter(
        5, "samples in a row that agree with each other after which a jump is taken as a restart of the source", ge=2
    )


class FallbackParams(ParameterModel):
    """What happens without slip velocity: law on the observer's prediction, then slower, then HOLD."""

    observer_s: float = parameter(
        0.3,
        "time for which the observer may run on the wrench alone; skipped where there is no observer",
        unit="s",
        ge=0.0,
    )
    slow_down_s: float = parameter(0.5, "time in which the motion along the path comes to rest", unit="s", gt=0.0)
    evidence: float = parameter(
        0.08,
        "slip speed that wrench and motion show, while the sensor shows none, that makes it implausible",
        unit="m/s",
        gt=0.0,
    )


class LoadParams(ParameterModel):
    """Friction that cannot carry the load."""

    drop_speed: float = parameter(
        0.3, "speed of fall beyond the reference, gained while slipping, that is a fault", unit="m/s", gt=0.0
    )
    memory_s: float = parameter(0.6, "time constant with which a gained speed is forgotten", unit="s", gt=0.0)


class SafetyParams(ParameterModel):
    """Modes, and the command that is given where the law is not."""

    joint_damping: float = parameter(2.0, "joint damping where only gravity is held", unit="N m s/rad", ge=0.0)
    hold_stiffness: float = parameter(
        225.0,
        "joint stiffness over joint inertia in HOLD: square of the loop's natural frequency",
        unit="1/s^2",
        ge=0.0,
    )
    hold_damping: float = parameter(30.0, "joint damping over joint inertia in HOLD", unit="1/s", ge=0.0)
    hold_load_s: float = parameter(
        0.05, "how fast HOLD takes the load from the wrench where the model does not explain it", unit="s", gt=0.0
    )
    auto_enable: bool = parameter(True, "go to ACTIVE as soon as the inputs are good; false waits for ~/enable")
    auto_resume: bool = parameter(True, "return from a HOLD that an input caused; false waits for ~/enable")
    resume_after_s: float = parameter(0.1, "how long inputs must be good before that", unit="s", ge=0.0)
    resume_slip_linear: float = parameter(
        0.05,
        "slip speed above which the law does not begin: the object must come to rest in HOLD first",
        unit="m/s",
        gt=0.0,
    )
    resume_slip_angular: float = parameter(1.0, "the same for the angular slip speed", unit="rad/s", gt=0.0)
    saturated_s: float = parameter(0.1, "time in saturation after which the mode is DEGRADED", unit="s", gt=0.0)
    limits: LimitParams = Field(default_factory=LimitParams)
    inputs: InputParams = Field(default_factory=InputParams)
    fallback: FallbackParams = Field(default_factory=FallbackParams)
    load: LoadParams = Field(default_factory=LoadParams)

    @model_validator(mode="after")
    def _restart_after_a_step(self) -> SafetyParams:
        if self.limits.restart_after_s < self.limits.longest_step_s:
            raise ValueError("limits.restart_after_s must not be below limits.longest_step_s")
        return self
