"""From parameters to the numbers of the control cycle: the rooms that compute know no parameters."""
