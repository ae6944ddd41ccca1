"""The page of a run: 3D replay with linked plots in one file, and the same picture live."""

from slip_core.errors import require_extra


def require_page() -> None:
    """Check that the extra `page` is installed.

    Raises:
        InputError: a package of it is missing.
    """
    for package in ("trimesh", "uplot", "websockets"):
        require_extra(package, "the page", "page")
