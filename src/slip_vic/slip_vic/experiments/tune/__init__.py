"""Search for gains: which ones, how good a set of them is, the search itself, and the page about it."""
