"""Hooks of the documentation site (``mkdocs.yml``).

Pages of the repository root become pages of the site; links are rewritten accordingly. Formulas
become MathML, which browsers render without a script.
"""

import html
import re
from pathlib import Path

from latex2mathml.converter import convert
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parents[2]
ROOT_PAGES = {
    "README.md": "index.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
}
FORMULA = re.compile(r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>', re.DOTALL)
REPOSITORY_LINK = re.compile(
    r"\[([^\]]+)\]\((?:\.\./)*(?:app|jobs|tests|tools|web|LICENSE|NOTICE)[^)]*\)"
)


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages of the repository root."""
    for source, page in ROOT_PAGES.items():
        files.append(File.generated(config, page, abs_src_path=str(ROOT / source)))
    return files


def on_page_markdown(markdown: str, page: Page, **_: object) -> str:
    """Rewrite links between the root and ``docs``; links to source files become text."""
    depth = page.file.src_uri.count("/")
    if page.file.src_uri in ROOT_PAGES.values():
        markdown = markdown.replace("](docs/", "](")
    for source, target in ROOT_PAGES.items():
        markdown = re.sub(rf"\]\((?:\.\./)*{source}", f"]({'../' * depth}{target}", markdown)
    return REPOSITORY_LINK.sub(r"\1", markdown)


def on_page_content(content: str, **_: object) -> str:
    """Convert formulas to MathML."""

    def mathml(match: re.Match[str]) -> str:
        display = "block" if match[2] == "[" else "inline"
        return convert(html.unescape(match[3]), display=display)

    return FORMULA.sub(mathml, content)
