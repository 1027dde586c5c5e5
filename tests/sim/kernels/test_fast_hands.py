"""A hand that flies past the arm at 2.5 m/s is found at every millisecond, or before."""

from app.sim.cells.cell import load_cell
from app.sim.collision.kernels.contact import FINEST_STEP
from tests.sim.fast_hands import HAND_SPEED, passes

N = 400


def test_fast_hands_are_found_no_later_than_the_meshes_at_millisecond_substeps() -> None:
    found = list(passes(load_cell(), N, 65))
    touching = [one for one in found if one.touching is not None]
    for one in touching:
        assert one.reported is not None
        assert one.reported <= one.touching + FINEST_STEP
    assert len(found) > 0.6 * N
    assert min(one.speed for one in found) > 0.8 * HAND_SPEED
    assert len(touching) > 0.3 * len(found)
    # What a test of the ends alone would let pass.
    assert sum(one.clear_at_ends for one in touching) > 5
