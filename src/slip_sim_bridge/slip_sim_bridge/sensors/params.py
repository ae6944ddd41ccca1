"""Parameters of the sensors: what a sensor is, and the faults that can be switched on and off while it runs."""

from __future__ import annotations

from slip_core.device_params import JointSensorModel, SlipSensorModel, WrenchSensorModel
from slip_core.grasp_params import Six
from slip_core.params import ParameterModel, parameter

NO_BIAS: Six = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
CHIPS = 3


class SlipFaultParams(ParameterModel):
    """Faults seen in real slip sensors; all off by default, all changeable at run time."""

    gain: float = parameter(1.0, "reading over truth; uncalibrated real sensors: 0.7 to 0.93", runtime=True, gt=0.0)
    bias: Six = parameter(NO_BIAS, "constant added to readings, on pad axes", unit="m/s, rad/s", runtime=True)
    outlier_probability: float = parameter(0.0, "fraction of samples that are outliers", runtime=True, ge=0.0, le=1.0)
    dropout_probability: float = parameter(0.0, "fraction of samples that are lost", runtime=True, ge=0.0, le=1.0)
    lifted_chips: int = parameter(
        0, f"number of the {CHIPS} optical chips that have lost contact and read zero", runtime=True, ge=0, le=CHIPS
    )
    frozen: bool = parameter(False, "repeat the last reading under new stamps", runtime=True)
    invalid: bool = parameter(False, "report invalid samples (NaN)", runtime=True)
    silent: bool = parameter(False, "publish nothing", runtime=True)


class SlipSensorParams(SlipSensorModel):
    """Slip velocity sensor, simulated."""

    saturation_linear: float = parameter(10.0, "largest linear reading of each axis", unit="m/s", gt=0.0)
    noise_position: float = parameter(
        0.0,
        "slip_input displacement: standard deviation of each linear axis that can slip; for angles, divided by "
        "friction.torsional_radius",
        unit="m",
        ge=0.0,
    )
    sees_pads: bool = parameter(
        False, "the sensor also reads the shear of soft pads as slip; needs plant elastic, and slip_input twist or flag"
    )
    faults: SlipFaultParams = SlipFaultParams()


class WrenchSensorParams(WrenchSensorModel):
    """Force and torque sensor at the pad centre, simulated."""

    rate_hz: float = parameter(0.0, "measuring rate; 0 = every control cycle", unit="Hz", ge=0.0)
    latency_s: float = parameter(0.0, "time from measurement to arrival", unit="s", ge=0.0)
    gain: float = parameter(1.0, "reading over truth, before the bias", runtime=True, gt=0.0)
    bias: Six = parameter(NO_BIAS, "constant added to readings, on pad axes", unit="N, N m", runtime=True)
    silent: bool = parameter(False, "publish nothing", runtime=True)


class JointSensorParams(JointSensorModel):
    """Joint encoders. A joint state comes at every tick, because it starts the tick; its values may be old."""

    velocity: bool = parameter(True, "whether joint states include velocities; otherwise they are NaN")


class SensorsParams(ParameterModel):
    """What the sensors make of the truth."""

    slip: SlipSensorParams = SlipSensorParams()
    wrench: WrenchSensorParams = WrenchSensorParams()
    joint: JointSensorParams = JointSensorParams()
