"""Friction laws for the tests: parameters in, one contact step out, through the parts that the grasp step runs."""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.records import record
from slip_core.vectors import Sym, Vec
from slip_sim_bridge.friction import friction_law
from slip_sim_bridge.friction.limit_surface import scaled, substeps_needed
from slip_sim_bridge.friction.params import FrictionParams, LugreParams

NO_STATE = (0.0, 0.0, 0.0)


class Contact(NamedTuple):
    """One step on pad axes: force (3,), velocity (3,), whether nothing slid or flowed, and the law's next state."""

    force: Array
    velocity: Array
    stick: bool
    state: tuple[float, float, float]


@functools.cache
def compiled(law):
    """The three parts of a law, called with its packed parameters."""
    layout = law.LAYOUT

    @part
    def limit(parameters, speed, normal_force):
        return law.limit(record(parameters, layout), speed, normal_force)

    @part
    def fall(parameters, normal_force):
        return law.steepest_fall(record(parameters, layout), normal_force)

    @part
    def solve(parameters, u_free, A_hat, normal_force, dt, state):
        return law.solve(record(parameters, layout), u_free, A_hat, normal_force, dt, state)

    return limit, fall, solve


class Law:
    """A law with its parameters."""

    def __init__(self, params: FrictionParams) -> None:
        self.params = params
        self.module, self.parameters = friction_law(params)
        self._limit, self._fall, self._solve = compiled(self.module)

    def limit(self, speed, normal_force):
        """F(s) and dF/ds."""
        return self._limit(self.parameters, float(speed), float(normal_force))

    def steepest_fall(self, normal_force):
        """max(0, -min dF/ds)."""
        return self._fall(self.parameters, float(normal_force))

    def contact(self, v_free, A, normal_force, dt=1e-3, state=NO_STATE, rho=0.03) -> Contact:
        """v = v_free + A f under a normal force above 0."""
        remembers = self.params.model == "lugre"
        assert rho == self.params.torsional_radius or not remembers
        u_free = Vec(float(v_free[0]), float(v_free[1]), rho * float(v_free[2]))
        f, u, following = self._solve(
            self.parameters, u_free, scaled(rho, upper(A)), float(normal_force), float(dt), Vec(*state)
        )
        if remembers:
            turn = dt * u[2] / rho
            stretched = np.array(state) + dt * np.array(u)
            unturned = np.array(following) - turn * np.array((-state[1], state[0], 0.0))
            stick = bool(np.abs(unturned - stretched).max() <= 1e-12 * np.abs(stretched).max())
        else:
            stick = tuple(u) == (0.0, 0.0, 0.0)
        force, velocity = np.array((f[0], f[1], rho * f[2])), np.array((u[0], u[1], u[2] / rho))
        return Contact(force, velocity, stick, tuple(following))

    def substeps(self, A, normal_force, rho=0.03):
        """Into how many sub-steps a step must be split."""
        return substeps_needed(self.steepest_fall(normal_force), scaled(rho, upper(A)))


def upper(A) -> Sym:
    """The symmetric matrix (3, 3) as the parts take it."""
    return Sym(*(float(A[i, j]) for i in range(3) for j in range(i, 3)))


def coulomb(mu, rho=0.03) -> Law:
    return Law(FrictionParams(model="coulomb", mu_s=mu, mu_k=mu, torsional_radius=rho))


def stribeck(mu_s=0.5, mu_k=0.4, velocity=0.05, viscous=0.0, rho=0.03) -> Law:
    return Law(FrictionParams(mu_s=mu_s, mu_k=mu_k, stribeck_velocity=velocity, viscous=viscous, torsional_radius=rho))


def lugre(stiffness, damping, breakaway_fraction=0.95, *, mu_s=0.5, mu_k=0.4, viscous=0.05, rho=0.03) -> Law:
    bristles = LugreParams(stiffness=stiffness, damping=damping, breakaway_fraction=breakaway_fraction)
    return Law(
        FrictionParams(model="lugre", mu_s=mu_s, mu_k=mu_k, viscous=viscous, torsional_radius=rho, lugre=bristles)
    )
