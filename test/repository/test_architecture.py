"""The import arrows between packages, held on the source text: whatever is not listed is forbidden."""

import ast
import sys
from pathlib import Path

import pytest

SRC = Path(__file__).parents[2] / "src"
PURE_MSGS = {
    f"slip_msgs_py.{m}"
    for m in (
        "arrays",
        "errors",
        "from_msgs",
        "params",
        "resources",
        "stamps",
        "topics",
        "types",
        "grasp_params",
        "timing",
        "realtime",
        "awake",
        "compiled",
        "small_kernel",
        "vector_kernel",
        "sym3_kernel",
        "pose_kernel",
    )
}
ROS = {"rclpy", "rcl_interfaces", "std_srvs", "lifecycle_msgs"} | {
    f"{m}_msgs" for m in ("std", "geometry", "sensor", "nav", "diagnostic", "rosgraph", "trajectory")
} | {"builtin_interfaces"}  # fmt: skip
NUMERIC = {"numpy", "yaml", "pydantic"}

# Longest prefix wins. Each value: what a module may import besides the standard library.
ALLOWED = {
    "slip_msgs_py": NUMERIC | ROS | {"slip_msgs_py"},
    **dict.fromkeys(PURE_MSGS, NUMERIC | PURE_MSGS),
    "slip_msgs_py.compiled": {"numba"},  # the only file that knows the compiler
    "slip_description": set(),
    "slip_vic_controller.core": {"numpy", "scipy", "pydantic", "slip_vic_controller.core"} | PURE_MSGS,
    "slip_vic_controller.core.arm": {"numpy", "pinocchio", "slip_vic_controller.core.arm_kernel"} | PURE_MSGS,
    "slip_vic_controller": {"slip_vic_controller", "slip_msgs_py"} | NUMERIC | ROS,
    "slip_sim_bridge.sim": {"numpy", "scipy", "mujoco", "pydantic", "slip_sim_bridge.sim"} | PURE_MSGS,
    "slip_sim_bridge": {"slip_sim_bridge", "slip_msgs_py"} | NUMERIC | ROS,
    "slip_bringup": None,  # may import everything
}


def imports(tree: ast.AST) -> set[str]:
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "relative imports hide the arrows"
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return found


def violations(module: str, text: str) -> list[str]:
    rule = ALLOWED[max((p for p in ALLOWED if f"{module}.".startswith(f"{p}.")), key=len)]
    if rule is None:
        return []
    return [
        name
        for name in sorted(imports(ast.parse(text)))
        if name.partition(".")[0] not in sys.stdlib_module_names
        and not any(f"{name}.".startswith(f"{allowed}.") for allowed in rule)
    ]


def modules() -> list[tuple[str, Path]]:
    result = []
    for path in sorted(SRC.glob("*/*/**/*.py")):
        parts = path.relative_to(SRC).with_suffix("").parts[1:]
        result.append((".".join(parts[:-1] if parts[-1] == "__init__" else parts), path))
    return result


@pytest.mark.parametrize(("module", "path"), modules(), ids=[m for m, _ in modules()])
def test_module_imports_only_what_its_layer_may(module: str, path: Path) -> None:
    assert violations(module, path.read_text()) == []


@pytest.mark.parametrize(
    ("module", "text"),
    [
        ("slip_vic_controller.core.law", "import rclpy"),
        ("slip_vic_controller.core.law", "import pinocchio"),
        ("slip_vic_controller.node", "from slip_sim_bridge.sim import friction"),
        ("slip_sim_bridge.node", "import slip_vic_controller"),
        ("slip_sim_bridge.sim.friction", "from slip_msgs_py import qos"),
        ("slip_description", "import numpy"),
        ("slip_msgs_py.types", "from geometry_msgs.msg import Twist"),
    ],
)
def test_the_rule_sees_a_forbidden_import(module: str, text: str) -> None:
    assert violations(module, text) != []
