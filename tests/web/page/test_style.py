"""Rules of the style sheets do not undo each other."""

import re
from collections import Counter
from pathlib import Path

PAGE = Path(__file__).parents[3] / "web" / "page"


def test_a_class_has_one_rule_of_its_own() -> None:
    sheets = (
        one.read_text() for one in sorted(PAGE.glob("**/*.css")) if "vendor" not in one.parts
    )
    rules = Counter(
        name for text in sheets for name in re.findall(r"^(\.[\w-]+) \{", text, re.MULTILINE)
    )
    assert [name for name, n in rules.items() if n > 1] == []
