"""Code, documents and page use the terms of ``docs/glossary.md``; a class name exists once."""

import pytest

from tools.check_vocabulary import banned, duplicates, in_python, in_text


def test_no_banned_word_is_used() -> None:
    assert list(banned()) == []


def test_a_class_name_exists_once() -> None:
    assert list(duplicates()) == []


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("the shipped sorter decides", ["sorter"]),
        ("movers and controllers", ["movers"]),
        ("`set-way` and joint_way_rad", ["way (set-way)", "way (joint_way_rad)"]),
        ("one of five ways", ["ways"]),
        ("by the way, a half-way stop in the robot's way", []),
        ("always in a gateway, either way", []),
        ("Who walks away is gone.", ["Who"]),
        ("Who is it?", []),
        ("beside people, held against FCL", ["held against"]),
        ("stroke-dasharray and border-style", []),
        ("nobody is near", []),
        ("`nobody`", ["nobody"]),
    ],
)
def test_words_and_phrases_of_text_are_found(text: str, found: list[str]) -> None:
    assert sorted(in_text(text)) == sorted(found)


def test_names_strings_and_comments_of_python_are_searched() -> None:
    source = 'n_ways = 1  # told anew\nlabel = "twins"\naxis.plot(x, dashes=(4, 3))\n'
    assert sorted(in_python(source)) == [
        (1, "anew"),
        (1, "told"),
        (1, "ways (n_ways)"),
        (2, "twins"),
    ]


@pytest.mark.parametrize(
    ("source", "found"),
    [
        ('"""Why it was held against it."""\n', "held against"),
        ("# for want of space\n", "for want of"),
        ('label = "the source\'s"\n', "the source's"),
        ('label = """Who walks away"""\n', "Who"),
    ],
)
def test_phrases_of_python_are_found(source: str, found: str) -> None:
    assert [word for _, word in in_python(source)] == [found]
