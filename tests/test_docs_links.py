"""Links of README, documents and model cards lead to files and headings that exist."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")),
    *sorted(DOCS.glob("**/*.md")),
    *sorted((ROOT / "app/policies").glob("**/pretrained/*.md")),
]
HEADING = re.compile(r"^(#+) (.+)$", re.MULTILINE)
LINK = re.compile(r"\]\(([^)\s]+)\)")


def slugs(text: str) -> set[str]:
    """Anchors of a page's headings, as GitHub makes them."""
    return {
        re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")
        for _, title in HEADING.findall(text)
    }


def broken_links(page: Path, text: str) -> list[str]:
    """Links to files or anchors that do not exist."""
    broken = []
    for link in LINK.findall(text):
        if re.match(r"[a-z]+:", link):
            continue
        name, _, anchor = link.partition("#")
        target = page.parent / name if name else page
        if not target.exists():
            broken.append(link)
        elif anchor and anchor not in slugs(text if not name else target.read_text("utf-8")):
            broken.append(link)
    return broken


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_resolve(page: Path) -> None:
    assert broken_links(page, page.read_text("utf-8")) == []


@pytest.mark.parametrize("link", ["no.md", "#no-heading", "method.md#no-heading"])
def test_a_broken_link_is_found(link: str) -> None:
    assert broken_links(DOCS / "method.md", f"# Title\n[one]({link})") == [link]


def test_every_picture_is_shown_in_a_document() -> None:
    shown = {
        (page.parent / link).resolve()
        for page in PAGES
        for link in LINK.findall(page.read_text("utf-8"))
        if not re.match(r"[a-z]+:", link)
    }
    stored = {path for path in (DOCS / "img").glob("**/*") if path.is_file()}
    assert stored and stored <= shown


def test_the_site_lists_every_page() -> None:
    text = (ROOT / "tools/docs/mkdocs.yml").read_text("utf-8")
    listed = set(re.findall(r"[\w/-]+\.md", text.split("\nnav:")[1]))
    of_root = {"index.md", "contributing.md", "changelog.md"}
    assert listed - of_root == {str(page.relative_to(DOCS)) for page in DOCS.glob("**/*.md")}
