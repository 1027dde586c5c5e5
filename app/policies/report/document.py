"""The report as one HTML file: figures are part of it, and it loads nothing."""

import base64
import re
from pathlib import Path

from markdown_it import MarkdownIt

IMAGES = Path(__file__).resolve().parents[3] / "docs/img"
STYLE = (
    "body{font:15px/1.5 system-ui,sans-serif;max-width:64rem;margin:2rem auto;padding:0 1rem;"
    "color:#1d232b}table{border-collapse:collapse;width:100%}img{max-width:100%}"
    "th,td{border-bottom:1px solid #ccd3db;padding:.3rem .6rem;text-align:left}"
    "h2{margin-top:3rem}small{color:#5b6672;overflow-wrap:anywhere}code{font-size:.9em}"
)
_IMAGE = re.compile(r'<img src="\.\./img/([a-z0-9/-]+\.(png|gif))" alt="([^"]*)" />')
_LINK = re.compile(r"(?<!!)\[([^\]]*)\]\((?!https?:)[^)]*\)")
_SMALL = re.compile(r"&lt;(/?)sub&gt;")


def document(markdown: str, title: str) -> str:
    """Return the report as HTML; links to pages of the documentation become text.

    Args:
        markdown: The page; HTML in it is shown as text.
        title: Title of the document, plain text.
    """
    reader = MarkdownIt("commonmark", {"html": False}).enable("table")
    body = _SMALL.sub(r"<\1small>", reader.render(_LINK.sub(r"\1", markdown)))
    head = MarkdownIt("zero").renderInline(title)
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{head}</title>'
        f"<style>{STYLE}</style></head><body>{_IMAGE.sub(_embedded, body)}</body></html>"
    )


def _embedded(image: re.Match[str]) -> str:
    """Return an image with its content; its description where there is no file."""
    path = IMAGES / image[1]
    if not path.is_file():
        return f"<em>{image[3]}</em>"
    content = base64.b64encode(path.read_bytes()).decode()
    return f'<img src="data:image/{image[2]};base64,{content}" alt="{image[3]}">'
