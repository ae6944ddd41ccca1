"""An object that hangs in two soft pads and is carried along a line: planar rigid body, gravity, LuGre friction.

Axes of the moving pads: x along the motion, y up, the origin at the pad centre, angles counterclockwise. The object's
centre of mass is at r, its twist at the pad centre is v = (vx, vy, w), and all forces are per mass of the object, so
that mass cancels. With the friction f = (fx, fy, tau) of the pads, their acceleration a(t) along x and the radius of
gyration k,
    rdd = (fx - a, fy - g),      k^2 wd = tau - (rx fy - ry fx),      v = (rxd + w ry, ryd - w rx, w).
f is that of `friction.lugre` on its limit surface |(fx, fy, tau / rho)| <= F: the weight takes most of F, so little is
left for torque, an object that turns in the pads also slides down in them, and one that slides far is lost. What the
pads hold falls with the way slid, because the grip relaxes and the object leaves the pads at its edge:
    share = max(0, 1 - thinning s) for s < release, else 0,      s = -(integral of vy).
The pads begin in equilibrium with the weight. Backward Euler in the friction, symplectic Euler in the motion.
Source: rigid-body mechanics in an accelerated frame; the friction law's own sources; thinning and release: ours.
"""

from __future__ import annotations

import math

from slip_core.arrays import Array
from slip_core.compiled import IN1, OUT2, REAL, VOID, kernel
from slip_core.records import Real, Record, dtype_of, record
from slip_core.vectors import Sym, Vec
from slip_sim_bridge.friction import lugre

G = 9.81  # m/s^2
COLUMNS = 4  # of a motion: angle [rad], x and y of the centre of mass [m], way slid down [m]


class HangingObject(Record):
    """What is carried, and how the pads let go of it."""

    lever: Real  # m, from the pad centre to the centre of mass
    gyration: Real  # m, radius of gyration about the centre of mass
    tilt: Real  # rad, of the lever at the start; 0 is straight below the pads, positive is ahead of them
    thinning: Real  # 1/m, share of the pads' hold that is lost per way slid
    release: Real  # m, way slid at which the object leaves the pads


OBJECT = dtype_of(HangingObject)


@kernel(VOID, IN1, IN1, IN1, IN1, REAL, OUT2)
def carry(numbers: Array, friction: Array, t: Array, a: Array, longest_step: float, motion: Array) -> None:
    """Simulate the motion of the object relative to the pads.

    Args:
        numbers: record `OBJECT`.
        friction: record `lugre.LAYOUT`, forces per mass, for a normal force of 1.
        t: stamps (n,) [s], not decreasing.
        a: acceleration of the pads along x at the stamps (n,) [m/s^2]; linear between them.
        longest_step: of the integration [s], > 0.
        motion: (n, COLUMNS), written: at each stamp.
    """
    thing: HangingObject = record(numbers, OBJECT)
    law = record(friction, lugre.LAYOUT)
    rho, inertia = law.torsional_radius, thing.gyration * thing.gyration
    rx, ry = thing.lever * math.sin(thing.tilt), -thing.lever * math.cos(thing.tilt)
    weight = Vec(0.0, G, rx * G / rho)
    state = (-1.0 / law.stiffness) * weight
    vx, vy, w, angle, slid = 0.0, 0.0, 0.0, 0.0, 0.0
    motion[0, 0], motion[0, 1], motion[0, 2], motion[0, 3] = angle, rx, ry, slid
    for i in range(1, t.size):
        steps = max(1, math.ceil((t[i] - t[i - 1]) / longest_step - 1e-9))
        dt = (t[i] - t[i - 1]) / steps
        for j in range(steps if dt > 0.0 else 0):
            along = (j + 0.5) / steps
            vx -= dt * ((1.0 - along) * a[i - 1] + along * a[i])
            vy -= dt * G
            share = 1.0 - thing.thinning * max(0.0, slid)
            if slid < thing.release and share > 0.0:
                c = dt / inertia
                about = Sym(ry * ry, -rx * ry, rho * ry, rx * rx, -rho * rx, rho * rho)
                A_hat = c * about
                A_hat = Sym(dt + A_hat.xx, A_hat.xy, A_hat.xz, dt + A_hat.yy, A_hat.yz, A_hat.zz)
                f, u, state = lugre.solve(law, Vec(vx + w * ry, vy - w * rx, w * rho), A_hat, share, dt, state)
                vx += dt * f.x
                vy += dt * f.y
                w += c * (rho * f.z - rx * f.y + ry * f.x)
                slid -= dt * u.y
            else:
                slid -= dt * (vy - w * rx)
            rx += dt * vx
            ry += dt * vy
            angle += dt * w
        motion[i, 0], motion[i, 1], motion[i, 2], motion[i, 3] = angle, rx, ry, slid
