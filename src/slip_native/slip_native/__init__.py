"""The control cycle as a C library: for real-time processes without Python.

`library` makes it from the compiled cycle, `header` declares it, `files` has what needs no compiler. Nothing here is
needed to run the Python nodes.
"""
