"""Find words that the glossary replaces, and class names that occur twice.

    python -m tools.check_vocabulary [PATH ...]    print file:line: word; status 1 if any

Paths restrict the search to files below them; class names are compared in the whole repository.
``docs/glossary.md`` lists the terms to use. A test runs the same checks.
"""

import ast
import io
import re
import subprocess
import sys
import tokenize
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from tools.arguments import parser_of

ROOT = (
    Path.cwd() if Path.cwd().joinpath("pyproject.toml").exists() else Path(__file__).parents[1]
)
CLASSES_IN = ("app", "jobs", "tools", "web")
TEXT = {
    ".py",
    ".md",
    ".js",
    ".html",
    ".css",
    ".json",
    ".toml",
    ".yaml",
    ".yml",
    ".sh",
    ".pddl",
    "",
}
EXCLUDED = re.compile(
    r"(^|/)(vendor|img)/|\.lock$|^(LICENSE|NOTICE)$|(^|/)(check_vocabulary|test_vocabulary)\.py$"
)
"""Third-party files, pictures, lock files, licences, and the list itself."""

WORDS = re.compile(
    r"dart(?:s|ing)?|foret(?:old|ells?|elling)|heed(?:s|ed|less|ing)?|move(?:rs?)|sorter(?:s)?"
    r"|reacher(?:s)?|pilot(?:s)?|twin(?:s)?|yardstick(?:s)?|court(?:esy|eous)|glitch(?:es|y)"
    r"|glitc[h]|repertoire(?:s)?|hind(?:sight)|teller(?:s)?|(?:un)?(?:told)|room(?:s)|house(?:s)?"
    r"|furni(?:ture)|citizen(?:s)?|lesson(?:s)?|ane(?:w)|who(?:ever|m)"
)
"""Banned in texts and as parts of names; written so that no renaming matches them."""
NAMES = re.compile(r"ways?|everyone|everybody|somebody|someone|nobody|dash|dashes|dashing")
"""Banned as identifiers and as parts of them."""
KEPT = re.compile(
    r"(?:one|two|half|right-of)-ways?|dashes(?==)|setLineDash"
    r"|stroke-dash\w*|border-\w+|digital twins?",
    re.IGNORECASE,
)
"""Names of others: of English, matplotlib (`dashes=`), Canvas 2D, SVG and CSS."""
CLAUSE = "of by for to with beside than from at near and or as".replace(" ", "|")
PHRASES = re.compile(
    r"\bfor want of\b|\bheld against\b|\bthe source's\b"
    r"|(?:(?<=[.!?:] )|(?<=^)|(?<=\"\"\"))Who (?=[a-z])(?![^.?]*\?)"
    rf"|\b(?:{CLAUSE}) who (?:was|has|\w+s)\b(?![^.]*\?)"
)
"""Phrases, and clauses with *who* as their subject."""
OF_PHRASES = re.compile(r"\bwant\b|\bagainst\b|\bsource's\b|\b[Ww]ho\b")
"""A word of each phrase."""
IDIOMS = re.compile(
    r"\bby the way\b|\b(?:in )?(?:this|that|the same|any|no|some|which|what) way\b"
    r"|\beither way\b|\bthe other way\b|\bright of way\b|\bthere is no way\b"
    r"|\b(?:one|two|half|all the|only|both|a long)[- ]ways?\b"
    r"|\b(?:give|gives|gave|giving|given) way\b|\bways? (?:to|of|in which)\b"
    r"|\b(?:in|into|out of|on) (?:the|its|their|his|her|(?:(?:the|a) )?[a-z]+'s) way\b"
    r"|\bthe way (?:it|they|a|the)\b",
    re.IGNORECASE,
)
"""Ordinary English with *way*; a path, plan, mode, distance or direction is called so."""
TOKEN = re.compile(r"[A-Za-z_$][\w$]*(?:-[A-Za-z]\w*)*")
PART = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+")


@cache
def parts(token: str) -> tuple[str, ...]:
    """Return the words an identifier is made of, in lower case."""
    return tuple(part.lower() for part in PART.findall(token))


@cache
def in_name(token: str) -> tuple[str, ...]:
    """Return the banned words in an identifier."""
    return tuple(one for one in parts(token) if WORDS.fullmatch(one) or NAMES.fullmatch(one))


def in_text(text: str) -> Iterator[str]:
    """Yield banned words and phrases of one line of text."""
    yield from (match[0].strip() for match in PHRASES.finditer(text))
    found = [match for match in TOKEN.finditer(text) if in_name(match[0])]
    if not found:
        return
    spans = [match.span() for match in IDIOMS.finditer(text)]
    ticks = [match.span() for match in re.finditer(r"`[^`\n]+`", text)]
    for match in found:
        token, at = match[0], match.start()
        if KEPT.match(text, at):
            continue
        words = parts(token)
        compound = "-" not in token and (len(words) > 1 or "_" in token)
        quoted = any(a <= at < b for a, b in ticks)
        if compound or quoted:
            yield from (
                f"{word} ({token})" if word != token else word for word in in_name(token)
            )
            continue
        for word in words:
            if WORDS.fullmatch(word):
                yield token
            elif word in ("way", "ways") and not any(a <= at < b for a, b in spans):
                yield token


def in_python(source: str) -> Iterator[tuple[int, str]]:
    """Yield line and banned word of a Python file."""
    # The split into tokens takes ten times as long as this search of most files.
    if not (OF_PHRASES.search(source) or any(map(in_name, TOKEN.findall(source)))):
        return
    lines = source.splitlines()
    names: dict[int, list[str]] = {}
    prose = [""] * len(lines)
    depth = (tokenize.STRING, tokenize.COMMENT, getattr(tokenize, "FSTRING_MIDDLE", -1))
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        row, end = token.start[0], token.end[0]
        if token.type == tokenize.NAME:
            names.setdefault(row, []).append(token.string)
        elif token.type in depth:
            for offset, line in enumerate(token.string.split("\n")[: end - row + 1]):
                prose[row - 1 + offset] += " " + line.strip()
    for row, found in names.items():
        for name in found:
            if name != "dashes":  # an argument of matplotlib
                yield from ((row, f"{word} ({name})") for word in in_name(name))
    for row, line in enumerate(prose, 1):
        yield from ((row, word) for word in in_text(line.strip()))


def tracked() -> list[str]:
    """Return the tracked text files that are searched."""
    listed = subprocess.run(
        ["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.splitlines()
    return [
        name
        for name in listed
        if Path(name).suffix in TEXT and not EXCLUDED.search(name) and (ROOT / name).is_file()
    ]


def banned(prefixes: tuple[str, ...] = ("",)) -> Iterator[str]:
    """Yield ``file:line: word`` for every banned word in tracked files and their names."""
    for name in tracked():
        if not name.startswith(prefixes):
            continue
        yield from (f"{name}:0: {word} (file name)" for word in in_name(name))
        try:
            source = (ROOT / name).read_text(encoding="utf-8")
        except UnicodeDecodeError:
            continue
        if name.endswith(".py"):
            found = sorted(in_python(source))
        else:
            found = [
                (row, word)
                for row, line in enumerate(source.splitlines(), 1)
                for word in in_text(line)
            ]
        yield from (f"{name}:{row}: {word}" for row, word in found)


def duplicates() -> Iterator[str]:
    """Yield class names that occur in more than one place, with the places."""
    places: dict[str, list[str]] = {}
    for name in tracked():
        if name.endswith(".py") and name.startswith(tuple(f"{one}/" for one in CLASSES_IN)):
            for node in ast.walk(ast.parse((ROOT / name).read_text(encoding="utf-8"))):
                if isinstance(node, ast.ClassDef):
                    places.setdefault(node.name, []).append(f"{name}:{node.lineno}")
    for found, where in sorted(places.items()):
        if len(where) > 1:
            yield f"class {found}: {', '.join(where)}"


def main() -> int:
    """Print what is found below the given paths; return the exit status."""
    parser = parser_of(__doc__)
    parser.add_argument("paths", nargs="*", metavar="PATH", help="all files, if none is given")
    given = parser.parse_args().paths
    prefixes = tuple(path.removeprefix("./") for path in given) or ("",)
    found = list(banned(prefixes))
    twice = [line for line in duplicates() if any(one in line for one in prefixes)]
    sys.stdout.write("".join(f"{line}\n" for line in found + twice))
    sys.stderr.write(f"{len(found)} banned words, {len(twice)} class names that occur twice\n")
    return 1 if found or twice else 0


if __name__ == "__main__":
    sys.exit(main())
