"""Arguments of the generators and scripts."""

import argparse


def parser_of(description: str | None) -> argparse.ArgumentParser:
    """Return a parser whose help is the docstring of a module, line by line.

    A script without arguments parses them all the same: ``--help`` would start it otherwise,
    and most of them replace files.
    """
    return argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
