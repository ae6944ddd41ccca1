"""Parameters of everything between the law and the joints: limits, input validation, degradation."""

from __future__ import annotations

from pydantic import Field

from slip_core.params import ParameterModel, parameter


class LimitParams(ParameterModel):
    """What no command exceeds, whatever mode it comes from; effort and velocity limits themselves are the URDF's."""

    effort_rate: float = parameter(1000.0, "largest change of a joint's effort", unit="N m/s", gt=0.0)
    position_margin: float = parameter(
        0.1,
        "distance from a joint's stop from which it is pushed back, with an effort that grows to the joint's limit",
        unit="rad",
        gt=0.0,
    )
    speed_linear: float = parameter(
        2.25, "speed of the pad that no goal and no governed path exceeds; half above is a fault", unit="m/s", gt=0.0
    )
    speed_angular: float = parameter(
        7.5,
        "angular speed of the pad that no goal and no governed path exceeds; half above is a fault",
        unit="rad/s",
        gt=0.0,
    )
    error_linear: float = parameter(
        0.3,
        "distance from the reference at which motion along the path stops; it slows down from half of that",
        unit="m",
        gt=0.0,
    )
    error_angular: float = parameter(
        6.0, "attitude error at which motion along the path stops; it slows down from half of that", unit="rad", gt=0.0
    )


class InputParams(ParameterModel):
    """Plausibility of the inputs; positions and velocities of the joints are judged against the URDF's limits."""

    age_s: float = parameter(0.05, "age above which the newest joint state or wrench is not used", unit="s", gt=0.0)
    slip_age_s: float = parameter(0.15, "age above which the newest slip velocity is not used", unit="s", gt=0.0)
    wrench: tuple[float, float] = parameter(
        (1000.0, 200.0), "force and torque above which a wrench is rejected", unit="N, N m"
    )
    slip: tuple[float, float] = parameter(
        (5.0, 100.0), "linear and angular speed above which a slip velocity is rejected", unit="m/s, rad/s"
    )
    frozen_s: float = parameter(
        0.1, "longest time for which values may stay exactly equal while the arm moves", unit="s", gt=0.0
    )
    bridge_s: float = parameter(
        0.05, "longest gap of good joint states in which the law goes on where the model has the arm", unit="s", ge=0.0
    )


class FallbackParams(ParameterModel):
    """What happens without slip velocity: law on the observer's prediction, then slower, then HOLD."""

    observer_s: float = parameter(
        0.3,
        "time for which the observer may run on the wrench alone; skipped where there is no observer",
        unit="s",
        ge=0.0,
    )
    slow_down_s: float = parameter(
        0.5,
        "time in which motion along the path comes to rest; one that friction has to brake gets twice that",
        unit="s",
        gt=0.0,
    )


class LoadParams(ParameterModel):
    """Drop detection: an object that falls."""

    drop_speed: float = parameter(
        0.3, "downward speed of the object beyond the reference, while it slips, that is a fault", unit="m/s", gt=0.0
    )


class SafetyParams(ParameterModel):
    """Modes, and the command that is sent when the law is not used."""

    hold_stiffness: float = parameter(
        225.0,
        "joint stiffness over joint inertia in HOLD: square of the natural frequency of the loop, which is critically "
        "damped",
        unit="1/s^2",
        runtime=True,
        ge=0.0,
    )
    auto_enable: bool = parameter(True, "go to ACTIVE as soon as the inputs are good; false waits for ~/enable")
    resume_after_s: float = parameter(
        0.1, "how long inputs must be good before the controller returns from HOLD by itself", unit="s", ge=0.0
    )
    limits: LimitParams = Field(default_factory=LimitParams)
    inputs: InputParams = Field(default_factory=InputParams)
    fallback: FallbackParams = Field(default_factory=FallbackParams)
    load: LoadParams = Field(default_factory=LoadParams)
