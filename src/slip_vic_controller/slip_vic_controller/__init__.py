"""Variable impedance controller for non-rigid grasps: the law, and the node that runs it."""
