"""Links between the pages of the documentation lead somewhere."""

import re
from pathlib import Path
from typing import Iterator, Set, Tuple

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").glob("*.md"))]
LINK = re.compile(r"\]\(([^)\s]+)\)")


def text_of(page: Path) -> str:
    """The page without its blocks of code."""
    return "\n".join(line for line in page.read_text().split("\n") if not line.startswith("    "))


def anchors_of(page: Path) -> Set[str]:
    """Those that the forges make of headings: lower case, letters, digits and hyphens, spaces as hyphens."""
    headings = re.findall(r"^#+ (.*)$", text_of(page), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}


def broken_links_of(page: Path) -> Iterator[Tuple[str, str]]:
    """Each with what is missing."""
    for link in LINK.findall(text_of(page)):
        if "://" in link:
            continue
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        if not target.exists():
            yield link, "no such file"
        elif anchor and anchor not in anchors_of(target):
            yield link, "no such heading"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path):
    assert list(broken_links_of(page)) == []


def test_a_broken_link_is_seen(tmp_path: Path):
    page = tmp_path / "page.md"
    page.write_text("# One (`a.cpp`)\n[a](#one-acpp) [b](#two) [c](other.md) [d](https://example.org/x#y)\n")
    assert list(broken_links_of(page)) == [("#two", "no such heading"), ("other.md", "no such file")]
