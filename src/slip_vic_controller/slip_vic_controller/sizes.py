"""Fixed sizes of the controller's records: one compilation serves every arm, unused places stay zero."""

from typing import Annotated, Final

from slip_core.arrays import Array
from slip_core.records import WholeArray

MAX_JOINTS: Final = 10
MAX_CONTACTS: Final = 4
ROOM: Final = 64
"""Segments of a built-in path, cycles of a moving average, and samples that wait: of slip and references for the next
cycle, where the oldest of more are dropped, and of a stream until it is followed."""
BISECTIONS: Final = 60
"""Steps after which a root in a bracket is known to rounding."""
NEVER: Final = -(2**63)
"""A time [ns] that has not been."""

Joints = Annotated[Array, MAX_JOINTS]
"""Field of a record: a number of each joint."""
WholeJoints = Annotated[WholeArray, MAX_JOINTS]
