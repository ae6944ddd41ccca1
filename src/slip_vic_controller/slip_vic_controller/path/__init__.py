"""Where the pad should be: built-in paths, goals, streams and joint paths, and the speed along them."""
