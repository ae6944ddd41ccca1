"""config/ and the reference pages are what the declarations say."""

from pathlib import Path

import pytest

from slip_bringup.reference import config_files, parameter_page, topic_page

ROOT = Path(__file__).parents[2]
FILES = {**{f"config/{name}": text for name, text in config_files().items()}}
FILES |= {"docs/parameters.md": parameter_page(), "docs/topics.md": topic_page()}


@pytest.mark.parametrize("name", FILES)
def test_file_is_up_to_date(name: str) -> None:
    fix = "run ./run params and ./run params --reference --out docs"
    assert (ROOT / name).read_text() == FILES[name], fix


def test_config_has_nothing_else() -> None:
    found = {str(path.relative_to(ROOT)) for path in (ROOT / "config").rglob("*.yaml")}
    assert found == {name for name in FILES if name.startswith("config/")}
