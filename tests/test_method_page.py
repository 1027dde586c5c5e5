"""``docs/method.md`` holds what code and documents cite, and can be rendered."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from matplotlib.mathtext import MathTextParser

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
TEXT = (DOCS / "method.md").read_text("utf-8")
SUFFIXES = {".py", ".md", ".js", ".html", ".css", ".json", ".pddl", ".toml", ".yaml"}
CITING = ("app", "jobs", "web", "docs", "tests", "tools")
NUMBER = r"\d+(?:\.\d+)*"
BETWEEN = r"(?:\s*,\s*(?:and\s+)?|\s+and\s+|\s+to\s+|\s*-\s*)"
CITATION = r"\b(?:METHOD|docs/method\.md`{0,2})[\s#*/]+"
CITED = re.compile(rf"{CITATION}({NUMBER}(?:{BETWEEN}{NUMBER}\b)*)")
HEADING = re.compile(r"^(#+) (.+)$", re.MULTILINE)
MATH = re.compile(r"\$\$(.+?)\$\$|\$([^$\n]+?)\$", re.DOTALL)


def cited_in(text: str) -> list[str]:
    """Section numbers that a text cites."""
    return [number for cited in CITED.findall(text) for number in re.findall(NUMBER, cited)]


def citing_files() -> Iterator[Path]:
    for folder in CITING:
        for path in sorted((ROOT / folder).rglob("*")):
            if path.is_file() and path.suffix in SUFFIXES and path != Path(__file__):
                yield path


def plain(text: str) -> str:
    """A page without its code."""
    return re.sub(r"`[^`\n]*`", "", re.sub(r"```.*?```", "", text, flags=re.DOTALL))


def numbers(text: str) -> list[str]:
    """Numbers of a page's headings, in its order; empty where a heading has none."""
    return [
        (re.match(rf"({NUMBER})\.? ", title) or [""] * 2)[1]
        for marks, title in HEADING.findall(text)
        if len(marks) > 1
    ]


def expected(found: list[str]) -> list[str]:
    """The same headings numbered one after the other."""
    chapter, section, out = 0, 0, []
    for number in found:
        if "." in number:
            section += 1
            out.append(f"{chapter}.{section}")
        else:
            chapter, section = chapter + 1, 0
            out.append(str(chapter))
    return out


def unbalanced(formula: str) -> bool:
    """Whether braces, brackets or a formula's \\left and \\right do not match."""
    pairs, open_ones = {")": "(", "]": "[", "}": "{"}, []
    for mark in re.findall(r"[(){}\[\]]", formula):
        if mark not in pairs:
            open_ones.append(mark)
        elif not open_ones or open_ones.pop() != pairs[mark]:
            return True
    return bool(open_ones)


@pytest.mark.parametrize(
    ("text", "sections"),
    [
        ("METHOD 2.1 to 2.3, 2.6, 2.7.", ["2.1", "2.3", "2.6", "2.7"]),
        ("(METHOD 2.1-2.3), compiled", ["2.1", "2.3"]),
        ("METHOD 1.2, who add", ["1.2"]),
        ("METHOD 2.6, and 4 for several", ["2.6", "4"]),
        ("stop (METHOD\n2.7)", ["2.7"]),
        ("METHOD 2.8 (30 Hz)", ["2.8"]),
        ("METHODS 3", []),
        ("Source: docs/method.md 2.1 to 2.3; thesis eq. (4.29).", ["2.1", "2.3"]),
        ("``docs/method.md`` 3.4", ["3.4"]),
        ("docs/method.md has 2 parts", []),
    ],
)
def test_citations_are_found_in_every_form(text: str, sections: list[str]) -> None:
    assert cited_in(text) == sections


def test_every_cited_section_exists() -> None:
    known = set(numbers(TEXT))
    cited = {
        (path.relative_to(ROOT).as_posix(), number)
        for path in citing_files()
        for number in cited_in(path.read_text("utf-8"))
    }
    assert len(cited) > 100
    assert {(path, number) for path, number in cited if number not in known} == set()


def test_modules_that_decide_by_default_are_listed() -> None:
    listed = TEXT.partition("## 7. ")[2].partition("## 8. ")[0]
    for module in ("inference/rollout", "inference/controllers", "kernels/improvement"):
        assert f"{module}.py" in listed
    assert "**Rollout**" in TEXT


def test_headings_are_numbered_without_gaps() -> None:
    found = numbers(TEXT)
    assert found == expected(found)


@pytest.mark.parametrize("found", [["1", "1.1", "1.3"], ["1", "3"], ["1", ""], ["1", "2.1"]])
def test_a_gap_in_the_numbers_is_seen(found: list[str]) -> None:
    assert found != expected(found)


def test_every_dollar_belongs_to_a_formula() -> None:
    assert "$" not in MATH.sub("", plain(TEXT))
    assert all(line.count("$") % 2 == 0 for line in plain(TEXT).splitlines())


def test_every_formula_is_balanced_and_can_be_typeset() -> None:
    formulas = [display or inline for display, inline in MATH.findall(plain(TEXT))]
    assert [formula for formula in formulas if unbalanced(formula)] == []
    parser = MathTextParser("path")
    for formula in formulas:
        parser.parse(f"${formula}$")


def test_no_formula_has_characters_that_markdown_takes_for_its_own() -> None:
    for display, inline in MATH.findall(plain(TEXT)):
        assert re.search(r"\\[^A-Za-z]", display or inline) is None
    for line in plain(TEXT).splitlines():
        if line.startswith("|"):
            assert not any("|" in inline for _, inline in MATH.findall(line)), line


@pytest.mark.parametrize("formula", ["(a", "a]", r"\frac{a}{b", "{(a})"])
def test_an_unbalanced_formula_is_seen(formula: str) -> None:
    assert unbalanced(formula)
