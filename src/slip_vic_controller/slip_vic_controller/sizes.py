"""Fixed sizes of the controller's records: one compilation serves every arm, unused places stay zero."""

from typing import Annotated, Final

from slip_core.arrays import Array
from slip_core.records import WholeArray

MAX_JOINTS: Final = 10
MAX_CONTACTS: Final = 4
MAX_SEGMENTS: Final = 64
"""Segments of a built-in path."""
MAX_FRESH: Final = 64
"""Slip samples that may come between two cycles; of more the oldest are dropped."""
NEVER: Final = -(2**63)
"""A time [ns] that has not been."""

Joints = Annotated[Array, MAX_JOINTS]
"""Field of a record: a number of each joint."""
WholeJoints = Annotated[WholeArray, MAX_JOINTS]
