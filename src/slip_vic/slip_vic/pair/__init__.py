"""Two arms on one object: scenarios, the closed loop in one process, and a study of random mismatch."""
