"""Pictures of arm and object by MuJoCo's own renderer, from recorded postures; no physics."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from slip_core.arrays import Array, matrix_from_quat_xyzw
from slip_core.errors import InputError
from slip_sim_bridge.params import BridgeParams
from slip_sim_bridge.plant.model import OBJECT
from slip_sim_bridge.plant.rigid import build_model

DISTANCE, AZIMUTH, ELEVATION = 1.7, 125.0, -28.0
"""Of the camera [m], [deg]."""


class Picture:
    """Draws one instant after the other.

    Args:
        params: whose arm and object.
        urdf: the arm.
        size: width and height [pixels].
        look_at: (3,) [m] {w}.

    Raises:
        InputError: OpenGL cannot draw without a display here.
    """

    def __init__(self, params: BridgeParams, urdf: str, size: tuple[int, int], look_at: Array) -> None:
        self._model = build_model(params, urdf)
        self._model.vis.global_.offwidth, self._model.vis.global_.offheight = size
        self._data = mujoco.MjData(self._model)
        self._joints = len(params.joint_names)
        self._thing = self._model.geom(f"{OBJECT}_drawn").id
        self._camera = mujoco.MjvCamera()
        self._camera.lookat[:] = look_at
        self._camera.distance, self._camera.azimuth, self._camera.elevation = DISTANCE, AZIMUTH, ELEVATION
        try:
            self._renderer: Any = mujoco.Renderer(self._model, size[1], size[0])
        except Exception as error:  # of OpenGL, EGL or GLFW, whichever is there
            fix = "MUJOCO_GL=egl, with a driver (apt install libegl1 libgl1-mesa-dri)"
            raise InputError("--video", got=str(error), expected="OpenGL without a display", fix=fix) from None

    def draw(self, joints: Array, pose: Array | None) -> NDArray[np.uint8]:
        """Return the picture (h, w, 3); joints (n,) [rad], pose (7,) of the object {w} or None."""
        self._data.qpos[: self._joints] = joints
        mujoco.mj_kinematics(self._model, self._data)
        if pose is not None:
            self._data.geom_xpos[self._thing] = pose[:3]
            self._data.geom_xmat[self._thing] = matrix_from_quat_xyzw(pose[3:]).ravel()
        mujoco.mj_camlight(self._model, self._data)
        self._renderer.update_scene(self._data, self._camera)
        return np.asarray(self._renderer.render())

    def close(self) -> None:
        """Release the renderer."""
        self._renderer.close()
