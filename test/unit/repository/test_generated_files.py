"""config/ and the reference pages are what the declarations say."""

from pathlib import Path

import yaml

from slip_core.params import build
from slip_vic.scenarios import scenario_names
from slip_vic.scenarios.parameter_files import config_files, parameter_page, topic_page
from slip_vic.scenarios.scenario import NODES, load
from tools import evidence

ROOT = Path(__file__).parents[3]
FILES = {**{f"config/{name}": text for name, text in config_files().items()}}
FILES |= {"docs/parameters.md": parameter_page(), "docs/topics.md": topic_page()}


def test_files_are_up_to_date() -> None:
    fix = "run ./run params and ./run params --reference --out docs"
    assert [name for name, text in FILES.items() if (ROOT / name).read_text() != text] == [], fix


def test_evidence_page_is_up_to_date() -> None:
    assert (ROOT / "docs" / "evidence.md").read_text() == evidence.page(), "run python tools/evidence.py"


def test_config_has_nothing_else() -> None:
    found = {str(path.relative_to(ROOT)) for path in (ROOT / "config").rglob("*.yaml")}
    assert found == {name for name in FILES if name.startswith("config/")}


def test_parameters_of_a_config_file() -> None:
    """What a file leaves out is the default."""
    files = config_files()
    for scenario in scenario_names(1):
        loaded = load(scenario, law="vic")
        wanted = {
            "bridge": loaded.bridge,
            "controller_vic": loaded.controller,
            "controller_classical": load(scenario, law="classical").controller,
            "controller_vic_realtime": load(scenario, law="vic", mode="realtime").controller,
        }
        for name, params in wanted.items():
            node, model = NODES[name.split("_")[0]]
            (content,) = yaml.safe_load(files[f"{scenario}/{name}.yaml"]).items()
            assert content[0] == f"/**/{node}"
            assert build(model, content[1]["ros__parameters"], name) == params
