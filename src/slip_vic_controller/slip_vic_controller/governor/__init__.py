"""Where the pad should be: built-in paths, and the speed at which they are run through."""
