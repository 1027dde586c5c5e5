"""Copies of arrays in large pages."""

from typing import NamedTuple

import numpy as np

from app.policies.networks.large_pages import LINE, in_large_pages


class Pair(NamedTuple):
    first: np.ndarray
    rest: tuple[np.ndarray, int]


def test_copies_are_equal_apart_and_begin_at_lines() -> None:
    rng = np.random.default_rng(1)
    given = (
        Pair(rng.normal(size=(3, 5)).astype(np.float32), (rng.normal(size=7), 3)),
        np.empty(0),
    )
    found = in_large_pages(given)
    (first, (second, number)), empty = found
    assert isinstance(found[0], Pair) and number == 3 and empty.shape == (0,)
    np.testing.assert_array_equal(first, given[0].first)
    np.testing.assert_array_equal(second, given[0].rest[0])
    assert first.dtype == np.float32 and first.flags.c_contiguous
    assert first.ctypes.data % LINE == second.ctypes.data % LINE == 0
    first[:], second[:] = 0.0, 1.0
    assert (first == 0.0).all() and given[0].first.all()


def test_arrays_beyond_a_page_fit() -> None:
    large = np.arange(3_000_000, dtype=np.float32)
    (one, two) = in_large_pages((large, large + 1.0))
    np.testing.assert_array_equal(one + 1.0, two)
