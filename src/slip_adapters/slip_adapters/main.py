"""The processes of the adapters: signals are taken before the imports, which need a moment."""

from __future__ import annotations

from slip_msgs_py.stop_flag import StopFlag


def papillarray() -> int:
    """Entry point of ``slip_adapter_papillarray``."""
    return _run("PapillArray")


def xela() -> int:
    """Entry point of ``slip_adapter_xela``."""
    return _run("Xela")


def boolean() -> int:
    """Entry point of ``slip_adapter_bool``."""
    return _run("Boolean")


def _run(adapter: str) -> int:
    StopFlag().install()
    from slip_adapters import node
    from slip_msgs_py.node_main import run_node

    return run_node(getattr(node, adapter))
