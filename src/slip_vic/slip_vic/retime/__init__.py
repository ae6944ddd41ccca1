"""`slip-vic retime`: the same path, with a timing that the friction of the grasp admits."""
