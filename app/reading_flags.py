"""Flags of the command line that state how a recording is read."""

import argparse

from app.sim.mocap.read_options import ReadOptions, name_map


def add_flags(parser: argparse.ArgumentParser) -> None:
    """Add the flags to a verb that reads recordings."""
    parser.add_argument("--unit", help="unit of the lengths, such as cm, or metres per unit")
    parser.add_argument(
        "--root-unit", metavar="UNIT", help="unit of the root's path, if another"
    )
    parser.add_argument("--up", metavar="AXIS", help="axis that points up: y, z, ...; --up=-y")
    parser.add_argument(
        "--map",
        action="append",
        default=[],
        metavar="THEIRS=OURS",
        help="what a joint or column of the file is; may be repeated",
    )


def stated_options(options: argparse.Namespace) -> ReadOptions:
    """Return what the flags state.

    Raises:
        InvalidInput: A flag states no unit, no axis or no pair of names.
    """
    return ReadOptions(
        unit=options.unit,
        root_unit=options.root_unit,
        up=options.up,
        names=name_map(options.map),
    )
