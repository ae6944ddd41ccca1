"""The page of a run: 3D replay with linked plots in one file, and the same picture live.

page.py      bags in, one HTML file out
runs.py      what the page shows of a bag: poses, series, paths, on one grid of times
urdf.py      the arm as links, joints and shapes
plots.py     which series stand in which plot
packing.py   numbers and text as one compressed block
scripts.py   where three.js and uPlot come from
live.py      `slip-vic watch`: the same from topics
cli.py       `slip-vic report`, `slip-vic watch`
static/      the page itself: HTML, style, script
"""

from slip_core.errors import require_extra


def require_page() -> None:
    """Check that the extra `page` is installed.

    Raises:
        InputError: a package of it is missing.
    """
    for package in ("trimesh", "uplot", "websockets"):
        require_extra(package, "the page", "page")
