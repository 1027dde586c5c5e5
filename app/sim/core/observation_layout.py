"""Slices of the groups of features in an observation, and the bound of features."""

from collections.abc import Iterable

OBS_BOUND = 100.0
"""Bound of the observation spaces; times are clipped there, no other feature comes near it."""


def slices_of(sizes: Iterable[tuple[str, int]]) -> dict[str, slice]:
    """Return the slice of each group, from names and sizes in order."""
    slices, start = {}, 0
    for name, size in sizes:
        slices[name] = slice(start, start + size)
        start += size
    return slices
