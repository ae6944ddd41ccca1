"""The records of the control cycle: what is configured, what is remembered, what goes in and what comes out."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from slip_core.arrays import Array
from slip_core.records import Mat3, Pose, Real, Record, Records, Vec3, Vec6, Whole, WholeArray, dtype_of
from slip_vic_controller.arm.command import CommandLimits, SentCommand
from slip_vic_controller.arm.estimator import EstimatorConfig, JointEstimate, JointRecord
from slip_vic_controller.arm.tare import Tare, TareConfig
from slip_vic_controller.contact.observer import Motion, Observer, ObserverConfig
from slip_vic_controller.governor.grip import Grip, GripConfig
from slip_vic_controller.governor.layouts import GovernedPad, Governor, GovernorConfig
from slip_vic_controller.governor.plan import GRID_POINTS, GridPoint
from slip_vic_controller.interfaces import WrenchSensor
from slip_vic_controller.law.arm import Arm, DesiredMotion
from slip_vic_controller.law.config import LawConfig
from slip_vic_controller.law.contact import ContactSample
from slip_vic_controller.law.evaluation import Evaluation
from slip_vic_controller.law.extensions import CompensationState
from slip_vic_controller.law.gains import LawGains, Ramp
from slip_vic_controller.path.goals import Goal
from slip_vic_controller.path.paths import Path, PathScaling
from slip_vic_controller.path.stream import Stream
from slip_vic_controller.safety.conditions import REASONS, Condition, ConditionsConfig, Health, ModeState
from slip_vic_controller.safety.hold import Hold, HoldConfig
from slip_vic_controller.safety.motion import DropDetectionConfig, ObservedMotion
from slip_vic_controller.safety.validation import JointInput, JointLimits, SlipQueue, VectorInput, VectorLimits
from slip_vic_controller.sizes import MAX_CONTACTS, MAX_JOINTS, Joints

LEDGER = 3 + 4 * MAX_CONTACTS + 5 + 1


class ControllerConfig(Record):
    """All that does not change while the controller of an arm runs."""

    period_ns: Whole
    slow_down_s: Real  # s; time in which the path comes to rest
    start_s: Real  # s; of the trajectory
    has_observer: Whole
    pad_stiffness: Real  # N/m; for the bound on kappa
    drive_lag_s: Real  # from a command to the motion that it asks for
    slip_ahead_s: Real  # s; by which the object's part of the law's slip velocity is predicted, 0 = none of it is
    kappa_share: Real  # of that bound, which the drives leave
    kappa_late_s: Real  # s; by which efforts may be later than configured
    slip_delay_ns: Whole  # by which the stamps of slip samples are too late
    gate_shut: Whole  # whether the law takes the object as held
    handover: Whole  # Handover
    leaves_gravity: Whole  # whether the arm carries its own weight
    models_wrench: Whole  # whether there is no wrench sensor
    follows_stream: Whole  # whether the path is a governed stream of references
    follows_goals: Whole  # whether it leads from goal to goal
    k_s_limit: Real  # 1/s; upper bound of k_s in effect
    impedance_delay_s: Real  # for which a stiffness is judged
    fastest_rate: Real  # 1/s; largest D/M that the drives follow
    law: LawConfig
    gains: LawGains
    path: Path
    observer: ObserverConfig
    joint: JointLimits
    wrench: VectorLimits
    slip: VectorLimits
    conditions: ConditionsConfig
    drop: DropDetectionConfig
    hold: HoldConfig
    governor: GovernorConfig
    wrench_sensor: WrenchSensor
    grip: GripConfig
    estimator: EstimatorConfig
    command: CommandLimits
    tare: TareConfig


CONFIG = dtype_of(ControllerConfig)


class TaskState(Record):
    """What is remembered of the motion of the object that all arms hold.

    Poses are those of the first arm's pad; the others keep to it as they held the object when the law began.
    """

    begun: Whole  # whether the law of all arms began in one cycle
    start_ns: Whole  # when the trajectory did, in the time of the first arm's joint states
    taken: Whole  # how many references or goals have come
    forgets: Whole  # whether the goal is given up when the law works again
    path: PathScaling
    reference_known: Whole
    reference: DesiredMotion  # by topic
    desired: DesiredMotion  # of the last cycle
    governor: Governor
    grid: Annotated[Records[GridPoint], GRID_POINTS]  # the path as sampled
    goal: Goal
    stream: Stream


TASK_STATE = dtype_of(TaskState)


class LawState(Record):
    """What the law needs of the past."""

    known: Whole
    stamp_ns: Whole  # of the last joint state
    start_position: Vec3  # m {w}; pose of the pad when the law began
    start_rotation: Mat3
    posture: Joints  # rad
    position: Joints  # rad; the last finite joint position
    gravity: Joints  # N m; g there
    e_previous: Vec3  # rad
    slips: Annotated[Records[Pose], MAX_CONTACTS]
    ramp: Ramp
    given_up: CompensationState


class ArmState(Record):
    """What is remembered of one arm."""

    cycles: Whole
    now_ns: Whole
    outside: Whole  # Fault: who else publishes
    joint: JointInput
    wrench_inputs: Annotated[Records[VectorInput], MAX_CONTACTS]
    slip_inputs: Annotated[Records[VectorInput], MAX_CONTACTS]
    wrench_modelled: Whole  # whether the model tells the wrench of all contacts
    wrench_of_model: Annotated[Array, (MAX_CONTACTS, 6)]  # N, N m on the axes of each pad
    queue: SlipQueue
    mode: ModeState
    conditions: Annotated[Records[Condition], REASONS]
    observed: ObservedMotion
    hold: Hold
    tuned: Ramp
    law: LawState
    observer: Observer
    pad: GovernedPad
    grip: Grip
    grasp: Pose  # its pad as the first arm's pad saw it when the law began
    estimate: JointEstimate
    sent: SentCommand
    tare: Tare


ARM_STATE = dtype_of(ArmState)
TASK_SIZE, ARM_SIZE = TASK_STATE.itemsize // 8, ARM_STATE.itemsize // 8
"""A state is the task, the rows of all arms, then each arm's history of the observer."""


class CycleInputs(Record):
    """What a cycle takes for one arm."""

    present: Whole  # whether the arm is answered in this cycle
    now_ns: Whole  # the controller's clock
    request: Whole  # Request
    missing: Whole  # bits of what else is missing
    health_given: Whole
    health: Health  # of the inputs where it is given, by a replay
    arm: Arm  # at the joint state that is answered


INPUTS = dtype_of(CycleInputs)


class Governed(Record):
    """What is published of the governor; loads in N."""

    path_s: Real  # where on the path
    path_rate: Real  # and how fast
    friction_limit: Real  # N; F^
    load_commanded: Real  # N
    load_measured: Real  # N
    load_ratio: Real  # commanded load over F^
    guard: Real  # factor on a_C
    friction_events: Real  # how often F^ was made smaller
    given_up: Real  # whether the compensation is
    margin: Real  # load that may be asked over F^
    friction_share: Real  # measured load over F^
    slipping: Real  # 1 while the slip input shows slip
    grip_command: Real  # N
    grip_force: Real  # N; as the gripper is taken to follow
    stream_waits: Real  # s; of a stream that has been received and is not run through yet
    goal: Real  # number of the goal under way
    goal_phase: Real  # its GoalPhase
    goal_progress: Real  # share of its path that is done
    limit: Real  # Limit that leaves no acceleration of the path; 0 = none


GOVERNED = dtype_of(Governed)


class CycleOutputs(Record):
    """What a cycle gives an arm."""

    before: ModeState  # of the cycle before
    decided: Whole  # whether the mode says what the arm does; else it has waited or held already
    answered: Whole  # 0 = no effort, something is missing
    ok: Whole  # whether `law` holds, and its effort went out
    ledger: Annotated[WholeArray, LEDGER]
    """All that the cycle depends on: its number, stamp of the joint state, then stamps of the newest wrench and slip
    velocity of each contact (none where they were not used); behind them the controller's clock, mode, health, request,
    and how many references or goals have been taken. Times are seconds and nanoseconds."""
    effort: Joints  # N m
    command: Joints  # N m, rad/s or rad: what the drives take
    saturated: Annotated[WholeArray, MAX_JOINTS]
    grip: Real  # N; commanded
    health: Health
    mode: ModeState
    path_scale: Real
    governor: Governed
    wanted: Joints  # N m; before limit avoidance
    samples: Annotated[Records[ContactSample], MAX_CONTACTS]
    slips: Annotated[Records[Pose], MAX_CONTACTS]
    follow_error: Vec6  # m/s^2, rad/s^2 {ee}
    gains: LawGains
    reference: DesiredMotion
    motion: Motion
    law: Evaluation
    sliding: Real  # 1 while the observer finds slip
    joints: JointRecord  # as estimated, zeros without an estimate; `effort` is that of the disturbance


class ArmCycle(NamedTuple):
    """An arm in a cycle: what is configured and remembered, what comes in and what goes out."""

    config: ControllerConfig
    task: TaskState
    state: ArmState
    inputs: CycleInputs
    outputs: CycleOutputs
    lead: bool  # whether it is the first arm, whose path is that of the object


class Arms(NamedTuple):
    """All arms in a cycle; the first one has the path."""

    configs: Records[ControllerConfig]
    task: TaskState
    states: Records[ArmState]
    inputs: Records[CycleInputs]
    outputs: Records[CycleOutputs]


OUTPUTS = dtype_of(CycleOutputs)
CONFIG_SIZE, INPUTS_SIZE, OUTPUTS_SIZE = CONFIG.itemsize // 8, INPUTS.itemsize // 8, OUTPUTS.itemsize // 8
"""What a cycle is called with has these records of every arm, one behind the other."""
