"""Two arms on one object in one controller: the cycle of both, and what is kept between cycles."""
