"""The interface of your own control law: its inputs and outputs, and how a law is found by name."""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import inspect
import os
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import ClassVar, Final, Protocol, cast, runtime_checkable

import numpy as np

from slip_core.arrays import Array
from slip_core.errors import InputError, UnknownName
from slip_core.types import JointSample, PadMotion, SlipSample, WrenchSample
from slip_vic_controller.params.controller_params import ControllerParams

NEEDS: Final = ("wrench", "slip", "grip")
"""What a law may need besides the arm itself."""
KNOWN: Final = {
    "classical": "slip_vic.experiments.ours:Classical",
    "vic": "slip_vic.experiments.ours:Vic",
    "governed": "slip_vic.experiments.ours:Governed",
    "governed_follow": "slip_vic.experiments.ours:GovernedFollow",
    "fixed_grip": "slip_vic.experiments.grip_laws:FixedGrip",
    "slip_aware_hold": "slip_vic.experiments.grip_laws:SlipAwareHold",
    "sun_slipping_control": "slip_vic.experiments.grip_laws:SunSlippingControl",
    "grasp_cbf": "slip_vic.experiments.grip_laws:GraspCbf",
    "proactive_slip_control": "slip_vic.experiments.proactive_slip_control:ProactiveSlipControl",
    "toppra_offline": "slip_vic.experiments.toppra_offline:ToppraOffline",
}
"""Laws that have a short name."""


@dataclass(frozen=True)
class Setup:
    """What is configured before a run; nothing in it comes from the simulated world.

    reference: the desired motion of the first pad at a time since the start of the run [s]; duration_s: when that
    motion ends [s]; period_s: of control [s]; friction_limit: force that the grasp can carry at the initial grip [N];
    torsional_radius: largest friction torque over largest friction force [m]; grip, most_grip: initial and largest
    squeeze, sum over both pads [N]; mass, inertia: of the object [kg], ixx iyy izz ixy ixz iyz [kg m2] {o}; gravity
    (3,) [m/s2] {w}; grasp_position, grasp_rotation: of the pad on the object; (3,) [m], (3, 3) {o}; parameters, urdfs:
    parameters and URDF of the controller, for each arm by its name.
    """

    reference: Callable[[float], PadMotion]
    duration_s: float
    period_s: float
    friction_limit: float
    torsional_radius: float
    grip: float
    most_grip: float
    mass: float
    inertia: Array
    gravity: Array
    grasp_position: Array
    grasp_rotation: Array
    parameters: Mapping[str, ControllerParams]
    urdfs: Mapping[str, str]


@dataclass(frozen=True, slots=True)
class Seen:
    """What one arm measures at a tick. What a law does not need (`Law.needs`) is zero or empty.

    time: since the start of the run [s]; q, qd (n,) [rad], [rad/s]; position (3,) [m], rotation (3, 3), twist (6,)
    [m/s, rad/s]: of the pad, {w}; J (6, n), M (n, n) [kg m2], bias (n,) [N m]: Jacobian {w}, joint inertia, C qd + g;
    wrench (6,) [N, N m] {ee}: the newest, of the object on the pad; slip (6,) [m/s, rad/s] {ee}: the newest slip
    velocity; grip: commanded squeeze [N]; stamp_ns, joint, wrenches, slips: the new samples themselves, oldest first;
    others: the other arms.
    """

    time: float
    q: Array
    qd: Array
    position: Array
    rotation: Array
    twist: Array
    J: Array
    M: Array
    bias: Array
    wrench: Array
    slip: Array
    grip: float
    stamp_ns: int
    joint: JointSample
    wrenches: tuple[WrenchSample, ...]
    slips: tuple[SlipSample, ...]
    others: tuple[Seen, ...] = field(default=())

    def way_to(self, wanted: PadMotion) -> Array:
        """Return how far the pad is from a reference; (6,) [m, rad] {w}, small turns."""
        turn = 0.5 * np.cross(self.rotation, wanted.rotation, axis=0).sum(axis=1)
        return np.concatenate((wanted.position - self.position, turn))


@dataclass(frozen=True, slots=True)
class Pad:
    """Acceleration of the pad; (6,) [m/s2, rad/s2] {w}, linear part first. It becomes an effort by Eq. (21).

    grip: commanded squeeze, sum over both pads [N]; None: as before.
    """

    acceleration: Array
    grip: float | None = None


@dataclass(frozen=True, slots=True)
class Effort:
    """Joint efforts (n,) [N m] with the arm's weight. grip: see `Pad`.

    Velocity and position drives get the motion of the modelled arm under these efforts.
    """

    effort: Array
    grip: float | None = None


Answer = Pad | Effort | None
"""None: no command; the arm holds its posture by itself."""


@runtime_checkable
class Law(Protocol):
    """A control law, constructed without arguments once for each run. No registration is needed.

        class MyLaw:
            needs = frozenset({"wrench"})
            def reset(self, setup): self.setup = setup
            def step(self, seen): return slip_vic.Pad(np.zeros(6))

    needs: of `NEEDS`. `reset` is called once, before the first `step`; slow work (planning, compiling) belongs there.
    `step` is called in every control period and returns `Pad`, `Effort` or None. A law for several arms has `several =
    True` and returns a tuple with one answer for each.
    """

    needs: ClassVar[frozenset[str]]

    def reset(self, setup: Setup) -> None:
        """Begin a run."""
        ...

    def step(self, seen: Seen) -> Answer | tuple[Answer, ...]:
        """Answer a tick."""
        ...


@dataclass(frozen=True, slots=True)
class FoundLaw:
    """A law that was found by its name.

    source: digest of its file; settings: assignments to the controller of the scenario.
    """

    kind: type[Law]
    source: str
    settings: tuple[str, ...] = ()


def find_law(name: str) -> FoundLaw:
    """Return a law: a name of `KNOWN`, `module:Class` or `file.py:Class`.

    A suffix `?number=value` changes a number of the class, `fixed_grip?factor=1.5`; a name with a dot is a parameter of
    the controller.

    Raises:
        InputError: no such law, its module cannot be imported, or it is not a law.
    """
    name, _, change = name.partition("?")
    full = KNOWN.get(name, name)
    where, colon, kind = full.rpartition(":")
    if not colon or not where or not kind:
        raise UnknownName("law", name, KNOWN, fix="(or module:Class, or file.py:Class)")
    leave, os._exit = os._exit, sys.exit  # type: ignore[assignment]  # which raises: no success in silence
    try:
        module = _module_of_file(Path(where)) if where.endswith(".py") else importlib.import_module(where)
        found = getattr(module, kind, None)
        file = inspect.getfile(found) if inspect.isclass(found) else ""
    except BaseException as error:  # whatever a module of someone else's does
        got = f"{type(error).__name__}: {error}"
        raise InputError(f"law {name}", got=got, expected="a module that can be imported") from error
    finally:
        os._exit = leave
    if not inspect.isclass(found):
        classes = [one for one, value in vars(module).items() if inspect.isclass(value)]
        raise UnknownName("law", kind, classes, where=where)
    needs = getattr(found, "needs", None)
    lacks = [method for method in ("reset", "step") if not callable(getattr(found, method, None))]
    if not isinstance(needs, (frozenset, set)) or not set(needs) <= set(NEEDS):
        lacks.append("needs")
    if lacks:
        expected = f"reset(setup), step(seen), and needs as a frozenset of {', '.join(NEEDS)}"
        raise InputError(f"law {name}", got=f"class {kind} without {', '.join(lacks)}", expected=expected)
    source = hashlib.sha256(Path(file).read_bytes()).hexdigest()[:16]
    key, _, value = change.partition("=")
    if change and "." not in key:
        try:
            found = type(kind, (found,), {key: {int: int, float: float}[type(getattr(found, key, None))](value)})
        except (KeyError, ValueError):
            expected = "?NUMBER=VALUE, of a number that the class has"
            raise InputError(f"law {name}", got=f"?{change}", expected=expected) from None
    return FoundLaw(cast("type[Law]", found), source, (f"controller.{change}",) if "." in key else ())


def _module_of_file(path: Path) -> ModuleType:
    """Import a file under a unique name; the same file once."""
    name = "slip_vic_law_" + hashlib.sha256(str(path.resolve()).encode()).hexdigest()[:12]
    if name in sys.modules:
        return sys.modules[name]
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None or not path.is_file():
        raise FileNotFoundError(f"no file {path}")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module
