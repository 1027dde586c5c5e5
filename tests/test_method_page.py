"""docs/method.md: every section that code and docs cite is there, and its links resolve."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "method.md").read_text()
HEADINGS = re.findall(r"^##+ (\d+(?:\.\d+)?)\.? ", PAGE, re.MULTILINE)
PARTS = {"app": "*.py", "jobs": "*.py", "web": "*.py", "tests": "*.py", "docs": "*.md"}


def cited() -> set[str]:
    """Sections that are cited as ``METHOD x.y`` anywhere in code, tests and docs."""
    found = set[str]()
    for part, pattern in PARTS.items():
        for path in (ROOT / part).rglob(pattern):
            found.update(re.findall(r"\bMETHOD (\d+(?:\.\d+)?)", path.read_text()))
    return found


def test_every_cited_section_is_a_heading() -> None:
    sections = cited()
    assert len(sections) > 15
    assert sections <= set(HEADINGS)


def test_sections_are_numbered_without_gaps() -> None:
    chapters = [int(number) for number in HEADINGS if "." not in number]
    assert chapters == list(range(1, len(chapters) + 1))
    for chapter in chapters:
        inside = [int(n.split(".")[1]) for n in HEADINGS if n.startswith(f"{chapter}.")]
        assert inside == list(range(1, len(inside) + 1))


def test_links_of_the_page_resolve() -> None:
    links = [one for one in re.findall(r"\]\(([^)#]+)", PAGE) if "://" not in one]
    assert links
    for link in links:
        assert (ROOT / "docs" / link).exists(), link


def test_equations_are_closed() -> None:
    text = re.sub(r"```.*?```|`[^`]*`", "", PAGE, flags=re.DOTALL)
    displayed = text.split("$$")
    assert len(displayed) % 2 == 1
    assert all(part.count("$") % 2 == 0 for part in displayed[::2])
