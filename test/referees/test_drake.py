"""A second physics engine judges the simulated grasp: Drake, patch contact (hydroelastic), solver SAP.

Two compliant round pads press a rigid plate; the hand moves as in a run of ours, or stands still while the plate is
pushed. Drake knows nothing of limit surfaces: it has Coulomb friction in every point of the patch. In discrete Drake
static and sliding friction are equal, so that the bridge has friction `coulomb` in all that is compared.

The bars below were written down before the first run, and stay as they are. `docs/fidelity.md` has what came of it.
"""

from __future__ import annotations

from typing import Final

import pytest

pytest.importorskip("pydrake", reason="Drake is not installed: pip install 'slip-vic[referee]'")

pytestmark = pytest.mark.referee

CREEP_M_S: Final = 20e-6
"""At 0.9 of the limit and steps of 1 ms the plate creeps by less. Loads: force along x and y of the pads, torque about
their normal; speed: mean over the second second of a constant load, turning times the torsional radius."""

BREAK_AWAY: Final = 0.10
"""Share by which force and torque at break-away differ from our limit surface |(f_x, f_y, tau / rho)| = mu N at most,
rho = 2/3 of the pads' radius (uniform pressure). Five directions: force along x and along y, torque, and force with
torque at 30 and 60 degrees of the scaled plane. The load rises from 0.8 to 1.2 of the limit in 2 s; break-away is where
the scaled speed passes 0.1 mm/s, five times the creep that is allowed below."""

PATH: Final = 0.15
"""Share by which the slip path of `paper_planar`, law classical, differs at most: final displacement, final angle, and
the largest distance at any time, of displacement as of angle, over the largest displacement, angle of ours."""

GOVERNED_M: Final = 0.1e-3
"""A governed run whose governor is configured with 10 % less friction than there is slips by less at any time, in Drake
too: displacement, and angle times the torsional radius."""
