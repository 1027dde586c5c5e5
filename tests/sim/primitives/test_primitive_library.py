"""The library a worker's motion is made of: keyframes are met, tables avoided, limits kept."""

import numpy as np
import pytest

from app.errors import InvalidInput, NotFound
from app.sim.cells.cell import Cell, load_cell
from app.sim.human import model as human
from app.sim.human.anthropometry import BodySize
from app.sim.primitives import primitive_library, promp
from app.sim.primitives.kernels.primitives import N_BASIS
from app.sim.primitives.library_file import load_primitives, primitive_for, segments_of
from app.sim.primitives.primitive_library import (
    BODIES,
    MotionLibrary,
    draw_samples,
    motion_library,
    people_sizes,
)
from tests.sim.library_motions import SegmentMotion, random_segments

N = 600


@pytest.fixture(scope="module")
def cell() -> Cell:
    return load_cell()


@pytest.fixture(scope="module")
def library(cell: Cell) -> MotionLibrary:
    return motion_library(cell, 0)


@pytest.fixture(scope="module")
def motions(cell: Cell, library: MotionLibrary) -> list[SegmentMotion]:
    return random_segments(cell, library, N, 1)


@pytest.mark.parametrize(("floor", "largest"), [(0.01, 4.02), (0.05, 1.24), (0.06, 1.19)])
def test_a_floor_keeps_the_gains_small(cell: Cell, floor: float, largest: float) -> None:
    known = [primitive_for(cell, segment).weights for segment in segments_of(cell)]
    both = [one for some in known for one in (some, some[..., ::-1])]
    gains = [np.abs(promp.gain_of_ends(one, floor)).max() for one in both]
    assert max(gains) == pytest.approx(largest, abs=0.005)
    assert {len(some) for some in known} == {60}


def moved(cell: Cell, offset: tuple[float, float], jitter: float, seed: int = 0) -> Cell:
    """Return a cell of which everything is moved, and the stations some more."""
    rng = np.random.default_rng(seed)
    shift, person, table = np.array([*offset, 0.0]), cell.human, cell.table
    stations = []
    for station in cell.stations:
        x, y, z = np.array(station.position) + shift + rng.uniform(-jitter, jitter, 3)
        stations.append(station.model_copy(update={"position": (x, y, z)}))
    x, y, yaw = person.home
    area = {f"x_{end}": getattr(person, f"x_{end}") + offset[0] for end in ("min", "max")}
    area |= {f"y_{end}": getattr(person, f"y_{end}") + offset[1] for end in ("min", "max")}
    edges = {f"x_{end}": getattr(table, f"x_{end}") + offset[0] for end in ("min", "max")}
    edges |= {f"y_{end}": getattr(table, f"y_{end}") + offset[1] for end in ("min", "max")}
    worker = person.model_copy(update={"home": (x + offset[0], y + offset[1], yaw), **area})
    return cell.model_copy(
        update={
            "stations": tuple(stations),
            "people": (worker,),
            "table": table.model_copy(update=edges),
        }
    )


def test_every_segment_meets_its_nodes(motions: list[SegmentMotion]) -> None:
    assert max(motion.end_miss for motion in motions) < 1e-3


def test_every_segment_ends_in_its_keyframes_joints(cell: Cell, library: MotionLibrary) -> None:
    for motion in random_segments(cell, library, 100, 5):
        ends = [
            np.abs(library.keyframes.postures - motion.q[k]).max(axis=1).min() for k in (0, -1)
        ]
        assert max(ends) < 1e-3


def test_segments_keep_the_joint_limits(motions: list[SegmentMotion]) -> None:
    assert np.mean([motion.beyond > 1e-3 for motion in motions]) <= 0.005


def test_hands_and_elbows_stay_out_of_the_table(motions: list[SegmentMotion]) -> None:
    assert min(motion.lowest for motion in motions) > -0.01


def test_palms_make_no_detours(motions: list[SegmentMotion]) -> None:
    longer = [motion.path - 2.0 * motion.straight for motion in motions]
    assert np.percentile(longer, 99) < 0.2


def test_no_joint_swings_out_on_the_path(motions: list[SegmentMotion]) -> None:
    swings = [motion.swing for motion in motions]
    assert np.median(swings) < 0.3 and np.percentile(swings, 99) < 0.9


def test_gains_are_tame(library: MotionLibrary) -> None:
    assert np.abs(library.gain).max() < 2.0


def test_gain_leaves_the_sample_free_where_it_already_meets_the_nodes(
    library: MotionLibrary,
) -> None:
    phi = promp.basis(np.array([0.0, 1.0]), N_BASIS, promp.usual_width(N_BASIS))
    rows = np.kron(np.eye(18), phi[:, None, :]).reshape(2, 18, 18 * N_BASIS)
    for gain in library.gain[::9]:
        np.testing.assert_allclose(rows.reshape(36, -1) @ gain, np.eye(36), atol=1e-6)


def test_segments_join_home_cubes_and_docks_with_both_hands(
    cell: Cell, library: MotionLibrary
) -> None:
    there = library.segments[..., 0] >= 0
    home, cubes = len(cell.pick_stations), range(library.keyframes.n_cubes)
    docks = range(library.keyframes.n_cubes, home)
    expected = np.zeros_like(there)
    for a, b in [(home, c) for c in cubes] + [(home, d) for d in docks]:
        expected[a, b] = expected[b, a] = True
    for cube in cubes:
        for dock in docks:
            expected[cube, dock] = expected[dock, cube] = True
    np.testing.assert_array_equal(there, expected)
    rows = library.segments[there]
    assert len(np.unique(rows[:, 0])) == len(rows) == len(library.gain) == len(library.duration)
    assert rows[:, 2].sum() == len(library.samples)


def test_backward_segment_takes_as_long_as_forward(library: MotionLibrary) -> None:
    forth, back = library.segments[8, 2, 0, 0], library.segments[2, 8, 0, 0]
    np.testing.assert_array_equal(library.duration[forth], library.duration[back])


def test_keyframes_of_every_body_reach_stations(cell: Cell, library: MotionLibrary) -> None:
    for person in range(len(library.bodies)):
        for place, station in enumerate(cell.pick_stations):
            for hand in range(2):
                first, count = library.keyframes.of_station[person, place, hand]
                palms = library.keyframes.hands[first : first + count, hand]
                assert np.linalg.norm(palms - station.position, axis=1).max() < 0.09


def test_keyframes_are_inside_the_limits(library: MotionLibrary) -> None:
    assert (library.keyframes.postures >= human.Q_MIN).all() and (
        library.keyframes.postures <= human.Q_MAX
    ).all()


def test_samples_keep_the_joint_limits(library: MotionLibrary) -> None:
    phi = promp.basis(np.linspace(0.0, 1.0, 61), N_BASIS, promp.usual_width(N_BASIS))
    q = phi @ np.swapaxes(library.samples, 1, 2)
    assert np.maximum(human.Q_MIN - q, q - human.Q_MAX).max() < 1e-3


def test_default_people_differ_and_lie_between_the_5th_and_95th_percentile(cell: Cell) -> None:
    assert 5 <= len(BODIES) <= 7
    assert np.min(BODIES) >= 5.0 and np.max(BODIES) <= 95.0
    statures = [size.stature for size in people_sizes(cell)]
    assert max(statures) - min(statures) > 0.25


def test_library_is_fixed_by_its_seed(cell: Cell) -> None:
    bodies = (BodySize(),)
    one = motion_library(cell, 3, bodies, 2, True, 1)
    motion_library.cache_clear()
    again, other = (motion_library(cell, seed, bodies, 2, True, 1) for seed in (3, 4))
    np.testing.assert_array_equal(one.samples, again.samples)
    np.testing.assert_array_equal(one.keyframes.postures, again.keyframes.postures)
    assert not np.array_equal(one.samples, other.samples)


def test_without_augmentation_samples_are_the_demonstrations(cell: Cell) -> None:
    library = motion_library(cell, 0, (BodySize(),), augmentation=False, variants=1)
    first = load_primitives()[0]
    np.testing.assert_array_equal(library.samples[: len(first.weights)], first.weights)
    np.testing.assert_array_equal(library.duration[:, 1], 0.0)


def test_draws_that_are_missing_are_demonstrations(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(primitive_library, "ROUNDS", 0)
    known = load_primitives()[0].weights
    drawn = draw_samples(load_primitives()[0], len(known) + 2, np.random.default_rng(1))
    np.testing.assert_array_equal(drawn, np.concatenate([known, known[:2]]))


def test_library_cannot_be_changed(library: MotionLibrary) -> None:
    for array in (library.keyframes.postures, library.samples, library.gain, library.segments):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0


def test_moved_cell_has_the_same_motion_elsewhere(cell: Cell) -> None:
    other = moved(cell, (0.5, 0.2), 0.0)
    for segment in segments_of(cell)[::7]:
        ours, theirs = primitive_for(cell, segment), primitive_for(other, segment)
        assert ours.segment == theirs.segment
        shift = theirs.weights - ours.weights
        np.testing.assert_allclose(shift[:, 0], 0.5, atol=1e-12)
        np.testing.assert_allclose(shift[:, 1], 0.2, atol=1e-12)
        np.testing.assert_array_equal(shift[:, 2:], 0.0)


def test_stations_of_ones_own_are_served_by_the_nearest_primitives(cell: Cell) -> None:
    other = moved(cell, (0.3, 0.1), 0.1)
    library = motion_library(other, 0, None, 6, True, 4)
    motions = random_segments(other, library, 300, 2)
    assert max(motion.end_miss for motion in motions) < 1e-3
    assert np.mean([motion.lowest < -0.01 for motion in motions]) < 0.02
    assert np.percentile([m.path - 2.0 * m.straight for m in motions], 99) < 0.2
    assert np.mean([motion.beyond > 1e-3 for motion in motions]) < 0.02


def test_cell_without_cubes_and_docks_is_refused() -> None:
    with pytest.raises(InvalidInput, match="sorting-e0.*at least one station of kind cube"):
        motion_library(load_cell("sorting-e0"), 0)


def test_cell_without_a_worker_is_refused(cell: Cell) -> None:
    with pytest.raises(NotFound, match="worker"):
        motion_library(cell.model_copy(update={"people": ()}), 0)
