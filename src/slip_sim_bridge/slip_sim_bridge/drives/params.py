"""Parameters of the simulated drives; the defaults are ideal: they do exactly what is commanded."""

from __future__ import annotations

from slip_core.device_params import EACH, CommandInterface, DriveModel, NotNegative
from slip_core.params import parameter


class DriveParams(DriveModel):
    """Drives of an arm."""

    interface: CommandInterface = parameter(
        "effort", "what the drives take: effort [N m], or velocity [rad/s] or position [rad] with a loop of their own"
    )
    viscous: tuple[NotNegative, ...] = parameter((), f"viscous friction of the joints; {EACH}", unit="N m s/rad")
    offset: tuple[float, ...] = parameter(
        (), f"interface effort: constant added to the effort at the joint; {EACH}", unit="N m"
    )
    gain: float = parameter(1.0, "interface effort: effort at the joint over effort of the drive", ge=0.1, le=10.0)
    ripple: float = parameter(
        0.0, "interface effort: amplitude of a torque that goes as the sine of six times the joint's position",
        unit="N m", ge=0.0,
    )  # fmt: skip
