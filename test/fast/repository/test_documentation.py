"""The pages tell the truth: every command they show runs, every link leads somewhere."""

import re
from pathlib import Path

from test.support.every import every

ROOT = Path(__file__).parents[3]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
# These have tests of their own that run them in full: the demo, the checks themselves, and the long measurements.


@every("page", PAGES)
def test_every_link_leads_to_a_file(page: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)\)", page.read_text()):
        assert target.startswith("http") or (page.parent / target).exists(), target


@every("page", PAGES)
def test_every_named_file_of_the_repository_exists(page: Path) -> None:
    pattern = r"`((?:src|test|config|docs|bags|tools)/[\w./-]+)`"
    for name in re.findall(pattern, page.read_text()):
        assert (ROOT / name).exists(), name
