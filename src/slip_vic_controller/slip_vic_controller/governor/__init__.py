"""The reference governor: the speed along the path, the grip and the guard."""
