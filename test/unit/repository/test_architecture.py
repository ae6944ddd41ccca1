"""The import arrows between packages, held on the source text: whatever is not listed is forbidden."""

import ast
import sys
from collections.abc import Iterable, Iterator, Mapping
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

SRC = Path(__file__).parents[3] / "src"
ROS = {"rclpy", "rosidl_parser", "rcl_interfaces", "std_srvs", "lifecycle_msgs"} | {
    f"{m}_msgs" for m in ("std", "geometry", "sensor", "nav", "diagnostic", "rosgraph", "trajectory")
} | {"builtin_interfaces"}  # fmt: skip
NUMERIC = {"numpy", "yaml", "pydantic"}
BAG_LIBRARIES = {"numpy", "yaml", "click", "rich", "mcap", "mcap_ros2", "zstandard", "lz4", "pandas"}
SHELLS = {"slip_core", "slip_msgs_py"} | NUMERIC | ROS
ROOMS = {
    "slip_core", "slip_msgs_py", "slip_description", "slip_vic_controller", "slip_sim_bridge", "slip_bags",
    "slip_native",
}  # fmt: skip
TOOLS = {"click", "rich", "matplotlib", "pandas", "scipy"}

# Longest prefix wins. Each value: what a module may import besides the standard library and its own package.
# Every key is a module that exists, and every module is below a key of its own package.
ALLOWED = {
    "slip_core": NUMERIC,
    "slip_core.compiled": set(),
    "slip_core.compiler": {"numba"},  # the only file that knows it, beside those of slip_native
    "slip_core.files.urdf_file": {"slip_core", "xacro"},
    "slip_core.records": {"numpy"},
    "slip_core.vectors": set(),
    "slip_msgs_py": {"numpy", "slip_core"} | ROS,
    "slip_description": set(),
    "slip_vic_controller": SHELLS,
    "slip_vic_controller.arm": {"numpy", "slip_core"},
    "slip_vic_controller.config": {"numpy", "scipy", "slip_core"},
    "slip_vic_controller.cycle": {"numpy", "slip_core"},
    "slip_vic_controller.cycle.governing": {"slip_core"},
    "slip_vic_controller.interfaces": {"numpy", "scipy", "slip_core"},
    "slip_vic_controller.law": {"numpy", "slip_core"},
    "slip_vic_controller.contact": {"numpy", "slip_core"},
    "slip_vic_controller.governor": {"numpy", "scipy", "slip_core"},
    "slip_vic_controller.path": {"numpy", "scipy", "slip_core"},
    "slip_vic_controller.robot": {"numpy", "pinocchio", "slip_core"},
    "slip_vic_controller.safety": {"numpy", "slip_core"},
    "slip_vic_controller.session": {"numpy", "slip_core"},
    "slip_vic_controller.state": {"slip_core"},
    "slip_sim_bridge": SHELLS,
    "slip_sim_bridge.friction": {"numpy", "pydantic", "slip_core"},
    "slip_sim_bridge.plant": {"numpy", "mujoco", "slip_core"},  # no other file knows MuJoCo
    "slip_sim_bridge.sensors": {"numpy", "pydantic", "slip_core"},
    "slip_bags": {"slip_core", "slip_msgs_py"} | BAG_LIBRARIES | ROS,
    "slip_native": {"slip_core", "slip_vic_controller", "numba", "llvmlite"},
    "slip_vic": ROOMS | NUMERIC | TOOLS | ROS,
    "slip_vic.page": ROOMS | NUMERIC | {"click", "pandas", "scipy", "trimesh", "websockets"} | ROS,
    "slip_vic.retime": ROOMS | NUMERIC | {"click", "matplotlib", "mcap_ros2", "pandas", "scipy"},
    "slip_vic.experiments.tune": ROOMS | NUMERIC | {"optuna"},
}
SHARED = {"slip_vic_controller.sizes", "slip_vic_controller.params.controller_params"}
CYCLE = {f"slip_vic_controller.{part}" for part in ("arm", "contact", "governor", "law", "path", "safety")} | SHARED
OWN = {  # layers inside a package: what of the own package a part may import
    "slip_core.compiled": {"slip_core.errors"},
    "slip_core.compiler": {"slip_core.compiled", "slip_core.records", "slip_core.vectors"},
    "slip_core.records": {"slip_core.arrays", "slip_core.stamps"},
    "slip_core.vectors": {"slip_core.arrays", "slip_core.compiled"},
    "slip_vic_controller.arm": {
        f"slip_vic_controller.{part}" for part in ("arm", "law.arm", "safety.conditions", "sizes")
    },
    "slip_vic_controller.config": CYCLE
    | {f"slip_vic_controller.{part}" for part in ("config", "state", "interfaces", "robot")},
    "slip_vic_controller.cycle": CYCLE | {f"slip_vic_controller.{part}" for part in ("cycle", "interfaces", "state")},
    "slip_vic_controller.cycle.governing": {
        f"slip_vic_controller.{part}" for part in ("contact", "cycle.sensing", "governor", "path", "law", "state")
    },
    "slip_vic_controller.interfaces": {"slip_vic_controller.robot", "slip_vic_controller.law.rotation", *SHARED},
    "slip_vic_controller.law": {"slip_vic_controller.law", *SHARED},
    "slip_vic_controller.contact": {
        f"slip_vic_controller.{part}" for part in ("contact", "law.contact", "law.rotation", "sizes")
    },
    "slip_vic_controller.governor": {
        f"slip_vic_controller.{part}"
        for part in (
            "governor",
            "contact.belief",
            "contact.estimate",
            "contact.friction_estimate",
            "contact.slip_health",
            "contact.wrench_evidence",
            "law.object",
            "law.rotation",
            "path.paths",
        )
    }
    | SHARED,
    "slip_vic_controller.path": {
        f"slip_vic_controller.{part}" for part in ("path", "law.arm", "law.rotation", "governor", "robot")
    }
    | SHARED,
    "slip_vic_controller.robot": {"slip_vic_controller.law.arm", *SHARED},
    "slip_vic_controller.safety": {
        f"slip_vic_controller.{part}"
        for part in (
            "safety",
            "path.paths",
            "contact.estimate",
            "contact.wrench_evidence",
            "law.arm",
            "law.contact",
            "law.extensions",
            "law.evaluation",
            "arm.command",
            "arm.estimator",
            "arm.tare",
        )
    }
    | SHARED,
    "slip_vic_controller.session": CYCLE
    | {f"slip_vic_controller.{part}" for part in ("config", "cycle", "interfaces", "robot", "session", "state")},
    "slip_vic_controller.state": CYCLE | {"slip_vic_controller.interfaces"},
    "slip_sim_bridge.friction": {"slip_sim_bridge.friction"},
    "slip_sim_bridge.plant": {f"slip_sim_bridge.{part}" for part in ("plant", "friction", "params")},
    "slip_sim_bridge.sensors": {"slip_sim_bridge.sensors", "slip_sim_bridge.params"},
}


def imports(nodes: Iterable[ast.AST]) -> set[str]:
    found = set()
    for node in nodes:
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "relative imports hide the arrows"
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return found


def rule_of(module: str) -> str:
    """Return the longest key of ALLOWED that covers a module, "" where there is none."""
    return max((key for key in ALLOWED if f"{module}.".startswith(f"{key}.")), key=len, default="")


def violations(module: str, text: str) -> list[str]:
    rule = rule_of(module)
    allowed = ALLOWED[rule] | OWN.get(rule, {module.partition(".")[0]})
    return [
        name
        for name in sorted(imports(ast.walk(ast.parse(text))))
        if name.partition(".")[0] not in sys.stdlib_module_names
        and not any(f"{name}.".startswith(f"{one}.") for one in allowed)
    ]


def modules() -> list[tuple[str, Path]]:
    result = []
    for path in sorted(SRC.glob("*/*/**/*.py")):
        package, *parts = path.relative_to(SRC).with_suffix("").parts
        if package != parts[0]:
            continue  # launch files: read by ros2 launch, imported by nobody
        result.append((".".join(parts[:-1] if parts[-1] == "__init__" else parts), path))
    return result


def loaded(node: ast.AST) -> Iterator[ast.AST]:
    """Yield what runs when a module is loaded: functions import later, and types are for the checker alone."""
    for child in ast.iter_child_nodes(node):
        typed = isinstance(child, ast.If) and ast.unparse(child.test) == "TYPE_CHECKING"
        if not typed and not isinstance(child, ast.FunctionDef):
            yield child
            yield from loaded(child)


def circle(texts: Mapping[str, str]) -> list[str]:
    """Return modules that import each other in a circle while they are loaded; texts: of the modules by name."""
    graph = {}
    for module, text in texts.items():
        names = imports(loaded(ast.parse(text)))
        graph[module] = {one for one in texts if any(name == one or name.rpartition(".")[0] == one for name in names)}
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


def test_no_modules_import_each_other_in_a_circle() -> None:
    assert circle({module: path.read_text() for module, path in modules()}) == []


def test_the_rule_sees_a_circle_of_modules() -> None:
    texts = {"a.b": "from a.c import x", "a.c": "from a import d", "a.d": "import a.b", "a": ""}
    assert set(circle(texts)) == {"a.b", "a.c", "a.d"}
    assert circle(texts | {"a.d": "if TYPE_CHECKING:\n    import a.b\ndef later():\n    import a.b"}) == []


def test_every_listed_module_exists() -> None:
    known = {module for module, _ in modules()}
    listed = set(ALLOWED) | set(OWN).union(*OWN.values())
    assert listed - known == set()


def test_every_module_is_covered() -> None:
    assert [module for module, _ in modules() if not rule_of(module)] == []


@pytest.mark.parametrize(("module", "path"), modules())
def test_module_imports_only_what_its_layer_may(module: str, path: Path) -> None:
    assert violations(module, path.read_text()) == []


@pytest.mark.parametrize(
    ("module", "text"),
    [
        ("slip_vic_controller.law.law", "import rclpy"),
        ("slip_vic_controller.cycle.cycle", "import pinocchio"),
        ("slip_vic_controller.node.controller_node", "from slip_sim_bridge import friction"),
        ("slip_sim_bridge.node", "import slip_vic_controller"),
        ("slip_sim_bridge.friction.lugre", "from slip_msgs_py import qos"),
        ("slip_sim_bridge.friction.lugre", "from slip_sim_bridge.plant import DivergenceError"),
        ("slip_sim_bridge.simulation", "import mujoco"),
        ("slip_description", "import numpy"),
        ("slip_core.types", "from geometry_msgs.msg import Twist"),
    ],
)
def test_the_rule_sees_a_forbidden_import(module: str, text: str) -> None:
    assert violations(module, text) != []
