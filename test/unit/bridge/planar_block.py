"""A rigid block held between two pads, planar, with constant mass matrix; only numpy and the friction law.

The block's twist V = (vx, vy, wz) is taken at its centre of mass, the contact twist is v = G^T V at `offset` from it.
The pads may be driven: `pad_velocity` is subtracted, so that a vibrating gripper loads the contact by inertia.
"""

from __future__ import annotations

import numpy as np

from .contact import NO_STATE, Law


class PlanarBlock:
    """mass [kg], inertia [kg m2], offset (2,) [m] of the pad centre from the centre of mass, normal_force [N]."""

    def __init__(self, law: Law, *, mass=0.5, inertia=2e-3, offset=(0.0, 0.0), normal_force=0.5, rho=0.03, dt=1e-3):
        self.law, self.normal_force, self.rho, self.dt = law, normal_force, rho, dt
        rx, ry = offset
        self.G = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-ry, rx, 1.0]])
        self.M = np.diag([mass, mass, inertia])
        self.A = dt * self.G.T @ np.linalg.solve(self.M, self.G)
        self.twist = np.zeros(3)  # at the centre of mass
        self.slip = np.zeros(3)  # integral of the contact twist relative to the pad
        self.state = NO_STATE
        self.solution = None

    @property
    def contact_twist(self):
        return self.G.T @ self.twist

    @contact_twist.setter
    def contact_twist(self, v):
        self.twist = np.linalg.solve(self.G.T, np.asarray(v, dtype=float))

    def step(self, load=(0.0, 0.0, 0.0), pad_velocity=(0.0, 0.0, 0.0)):
        """One step under `load` (3,) [N, N, N m] at the pad centre; returns the contact solution."""
        load = np.asarray(load, dtype=float)
        v_free = self.G.T @ self.twist + self.A @ load - np.asarray(pad_velocity)
        out = self.law.contact(v_free, self.A, self.normal_force, self.dt, self.state, self.rho)
        self.twist = self.twist + self.dt * np.linalg.solve(self.M, self.G @ (load + out.force))
        self.state = out.state
        self.slip = self.slip + self.dt * out.velocity
        self.solution = out
        return out
