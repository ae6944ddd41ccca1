"""A planar block between pads: closed forms, break-away, Stribeck curve, drift, convergence."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from .contact import coulomb, stribeck
from .planar_block import PlanarBlock

G0 = 9.81
CURVE = stribeck(0.5, 0.4, 0.05, 0.05)
FIRST_ORDER = 0.5  # backward Euler shortens a path by speed * dt / 2
FIRST_ORDER_SLACK = 1.2  # the next order, at the step sizes used here


@pytest.mark.parametrize("speed", [0.02, 0.3, 1.0])
def test_coulomb_block_slides_v2_over_2_mu_g(speed):
    mu, mass, dt = 0.4, 0.5, 1e-3
    block = PlanarBlock(coulomb(mu), mass=mass, normal_force=mass * G0, dt=dt)
    block.contact_twist = (speed, 0.0, 0.0)
    steps = block.slide_to_rest()
    assert steps == pytest.approx(speed / (mu * G0 * dt), abs=1.0)
    exact = speed**2 / (2 * mu * G0)
    assert block.slip[0] == pytest.approx(exact, abs=FIRST_ORDER_SLACK * FIRST_ORDER * speed * dt)
    assert block.slip[1] == block.slip[2] == 0.0


def test_coulomb_block_spins_to_rest():
    mu, normal_force, rho, inertia, rate, dt = 0.4, 2.0, 0.03, 2e-3, 8.0, 1e-3
    block = PlanarBlock(coulomb(mu), inertia=inertia, normal_force=normal_force, rho=rho, dt=dt)
    block.contact_twist = (0.0, 0.0, rate)
    block.slide_to_rest()
    exact = inertia * rate**2 / (2 * mu * normal_force * rho)
    assert block.slip[2] == pytest.approx(exact, abs=FIRST_ORDER_SLACK * FIRST_ORDER * rate * dt)


def test_coulomb_block_stops_on_a_slope():
    mu, mass, slope, speed, dt = 0.6, 0.5, 0.3, 0.5, 1e-3
    block = PlanarBlock(coulomb(mu), mass=mass, normal_force=mass * G0 * math.cos(slope), dt=dt)
    block.contact_twist = (speed, 0.0, 0.0)
    downhill = (mass * G0 * math.sin(slope), 0.0, 0.0)
    while not block.step(downhill).stick:
        pass
    deceleration = G0 * (mu * math.cos(slope) - math.sin(slope))
    assert block.slip[0] == pytest.approx(
        speed**2 / (2 * deceleration), abs=FIRST_ORDER_SLACK * FIRST_ORDER * speed * dt
    )
    assert block.step(downhill).stick, "it stays where it stopped"


def test_coulomb_with_viscous_friction_stops_where_the_exponential_says():
    mu, c, mass, normal_force, speed, dt = 0.4, 2.0, 0.5, 1.0, 0.5, 1e-4
    block = PlanarBlock(stribeck(mu, mu, 0.05, c), mass=mass, normal_force=normal_force, dt=dt)
    block.contact_twist = (speed, 0.0, 0.0)
    block.slide_to_rest()
    F, tau = mu * normal_force, mass / c  # m v' = -F - c v
    exact = tau * speed - F / c * tau * math.log1p(c * speed / F)
    assert block.slip[0] == pytest.approx(exact, abs=FIRST_ORDER_SLACK * FIRST_ORDER * speed * dt)


def test_translation_and_spin_end_together():
    """Coulomb friction on an ellipsoid leaves no direction of a body with rho^2 = J/m unbraked: both stop at once."""
    mass, rho = 0.5, 0.03
    block = PlanarBlock(coulomb(0.4), mass=mass, inertia=mass * rho**2, rho=rho, dt=1e-4)
    block.contact_twist = (0.1, 0.05, 4.0)
    direction = np.array([0.1, 0.05, 4.0 * rho])
    while not block.step().stick:
        moving = block.contact_twist * np.array([1.0, 1.0, rho])
        if np.linalg.norm(moving) > 0.0:
            np.testing.assert_allclose(
                moving / np.linalg.norm(moving), direction / np.linalg.norm(direction), atol=1e-9
            )


@pytest.mark.parametrize("law", [CURVE, coulomb(0.4)])
def test_slip_distance_converges_in_first_order(law):
    """A pull above the limit for 0.2 s, then sliding to rest: translation, spin and an offset at once."""

    def distance(dt):
        block = PlanarBlock(law, offset=(0.02, 0.01), normal_force=0.5, dt=dt)
        for k in range(round(0.2 / dt)):
            block.step((0.4 * math.sin(math.pi * (k + 0.5) * dt / 0.2), 0.1, 0.004))
        block.slide_to_rest()
        return block.slip * np.array([1.0, 1.0, block.rho])

    runs = [distance(dt) for dt in (2e-3, 1e-3, 5e-4, 2.5e-4, 1.25e-4)]
    gaps = [np.linalg.norm(a - b) for a, b in itertools.pairwise(runs)]
    ratios = [a / b for a, b in itertools.pairwise(gaps)]
    # First order halves the gap; where in a step the slip starts and ends adds a sawtooth of the same order.
    assert all(1.4 < ratio < 2.8 for ratio in ratios), ratios
    assert gaps[1] < 0.02 * np.linalg.norm(runs[-1]), "1 ms is within 2 % of the limit"
