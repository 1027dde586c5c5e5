"""The report as one HTML file."""

import re

from app.policies.report.document import document
from app.policies.report.page import RESULTS, TEXT, page


def test_document_has_every_table_and_figure_and_loads_nothing() -> None:
    html = document(page(RESULTS)[0], "report")
    assert html.count("<h3>") == TEXT.count("\n### ") > 20
    assert html.count("<table>") == TEXT.count("\n| --- |") > 15
    assert html.count('src="data:image/') == TEXT.count("\n![") > 10
    assert not re.search(r'src="(?!data:)|href="(?!https?:)|<script', html)
    assert "&lt;sub&gt;" not in html and "<small>" in html


def test_html_and_unknown_images_are_shown_as_text() -> None:
    html = document("<script>x</script> ![a](../img/../../etc/passwd.png) [b](../m.md)", "<t>")
    assert "<script>" not in html and "&lt;script&gt;" in html
    assert "data:image" not in html and "m.md" not in html
    assert "<title>&lt;t&gt;</title>" in html
    assert "<em>there is none</em>" in document("![there is none](../img/none.png)", "t")
