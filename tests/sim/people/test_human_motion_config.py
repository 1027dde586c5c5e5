"""What workers do: recorded runs as tracks, placed at the table; the library; the settings."""

import numpy as np
import pytest
from numba import typeof

from app.errors import InvalidInput
from app.sim.cells.cell import Cell, load_cell
from app.sim.collision.contact import clearance
from app.sim.human import model as human
from app.sim.human.anthropometry import BodySize, percentile_body
from app.sim.human.kernels.kinematics import PELVIS_Z
from app.sim.people.human_motion_config import (
    TRACK_DT,
    HumanMotionConfig,
    MotionSource,
    at_the_table,
    back_and_forth,
    tracks_of,
)
from app.sim.people.kernels.people import ABSENT
from app.sim.pick.batch import OUTCOMES, PickBatch, PickSettings
from app.sim.pick.kernels.observation_layout import LAYOUT
from app.sim.scenario.kernels.episode import COLLISION
from app.sim.scene.scene import arm_of, people_of
from tests.sim.recorded_person import working
from tests.sim.working_people import recorded_work, run_of

NO_PEDESTRIANS = np.zeros((0, 3))


@pytest.fixture(scope="module")
def cell() -> Cell:
    return load_cell()


def batch_of(
    cell: Cell, work: HumanMotionConfig, n_envs: int = 24, **more: object
) -> PickBatch:
    batch = PickBatch(cell, n_envs, 5, PickSettings(work=work, **more))  # type: ignore[arg-type]
    batch.reset()
    return batch


def stand(batch: PickBatch, n_steps: int = 1) -> None:
    """Let the robots stand still."""
    still = np.zeros((batch.n_envs, 5), dtype=np.float32)
    for _ in range(n_steps):
        batch.step(still, auto_reset=False, features=False)


def test_tracks_hold_the_positions_at_their_samples(cell: Cell) -> None:
    coarse, fine = run_of(working(60), dt=0.1), run_of(working(200, dt=0.004), dt=0.004)
    tracks, sizes = tracks_of((coarse, fine), cell.floor_z)
    assert tracks.spans.tolist() == [[0, 296, 0], [296, 41, 1]]
    np.testing.assert_allclose(tracks.rows[0:296:5, :18], coarse.q, atol=1e-9)
    np.testing.assert_allclose(tracks.rows[296:336, :18], fine.q[::5], atol=1e-9)
    np.testing.assert_array_equal(tracks.rows[336, :18], fine.q[-1])
    assert sizes.shape == (2, 12)
    again, sizes = tracks_of((coarse, fine, fine), cell.floor_z)
    assert again.spans.tolist() == [[0, 296, 0], [296, 41, 1], [296, 41, 1]]
    np.testing.assert_array_equal(again.rows, tracks.rows)
    assert sizes.shape == (2, 12)


def test_a_recorded_joint_may_leave_its_limits(cell: Cell) -> None:
    q = working(60)
    q[:, 13] = 4.0
    work = HumanMotionConfig(motion="recorded", recorded=(at_the_table(run_of(q), cell),))
    state = batch_of(cell, work, 4).state.people
    assert human.Q_MAX[13] < 4.0
    np.testing.assert_array_equal(state.q[:, 0, 13], 4.0)


def test_tracks_carry_who_was_recorded_and_how_high_the_pelvis_is(cell: Cell) -> None:
    size, height = BodySize(pelvis=0.9, forearm_r=0.3), np.linspace(0.0, -0.4, 60)
    tracks, sizes = tracks_of((run_of(working(60), 0.02, height, size),), cell.floor_z)
    np.testing.assert_allclose(tracks.rows[:, 18], height, atol=1e-12)
    np.testing.assert_array_equal(sizes[0], size.vector(cell.floor_z))


def test_a_worker_on_a_track_is_where_it_was_recorded_at_that_speed(cell: Cell) -> None:
    batch = batch_of(cell, recorded_work(cell))
    people, state = batch.world.people, batch.state.people
    before = state.clock.copy()
    stand(batch)
    running = np.flatnonzero(batch.state.outcome == OUTCOMES.index("running"))
    assert len(running) > 5 and len(np.unique(before)) > 20
    for e in running:
        assert state.clock[e, 0] == pytest.approx(before[e, 0] + batch.arm.dt)
        first, n, _ = people.tracks.spans[state.track[e, 0]]
        rows, at = people.tracks.rows[first : first + n], state.clock[e, 0] / TRACK_DT
        k = int(at)
        expected = rows[k] + (at - k) * (rows[k + 1] - rows[k])
        np.testing.assert_allclose(state.q[e, 0], expected[:18], atol=1e-9)
        speed = (rows[k + 1] - rows[k])[:18] / TRACK_DT
        np.testing.assert_allclose(state.qd[e, 0], speed, atol=1e-9)


def test_every_track_is_played_with_the_body_that_was_recorded(cell: Cell) -> None:
    batch = batch_of(cell, recorded_work(cell), 60)
    people, state = batch.world.people, batch.state.people
    assert set(state.track[:, 0]) == set(state.body[:, 0]) == {0, 1}
    np.testing.assert_array_equal(state.track, state.body)
    np.testing.assert_array_equal(state.size[:, 0, 1:], people.bodies[state.body[:, 0], 1:])


def test_past_the_end_of_a_track_the_person_stands_still(cell: Cell) -> None:
    run = at_the_table(run_of(working(60)), cell)
    work = HumanMotionConfig(motion="recorded", recorded=(run,), loop=False)
    batch = batch_of(cell, work)
    assert (batch.state.people.clock == 0.0).all()
    stand(batch, 40)
    running = batch.state.outcome == OUTCOMES.index("running")
    assert running.sum() > 5
    end = np.tile(run.q[-1], (running.sum(), 1))
    np.testing.assert_allclose(batch.state.people.q[running, 0], end, atol=1e-9)
    assert not batch.state.people.qd[running].any()


def test_a_person_who_crouches_has_lower_capsules(cell: Cell) -> None:
    q = np.tile(human.rest_posture(*cell.human.home), (60, 1))
    heights = {}
    for rise in (0.0, -0.4):
        run = run_of(q, pelvis_z=rise)
        batch = batch_of(cell, HumanMotionConfig(motion="recorded", recorded=(run,)), 2)
        size = batch.state.people.size[0, 0]
        assert size[PELVIS_Z] == pytest.approx(cell.body[PELVIS_Z] + rise)
        heights[rise] = batch.state.people.capsules[0, 2].copy()
        assert human.joint_points(q[0], size)["head"][2] == pytest.approx(
            human.joint_points(q[0], cell.body)["head"][2] + rise
        )
    fall = heights[-0.4] - heights[0.0]
    assert (fall > -0.41).all() and (np.abs(fall + 0.4) < 1e-9).sum() >= 10


def test_a_hand_that_sinks_past_the_tool_within_one_period_is_a_contact(cell: Cell) -> None:
    """The joints stand still: only the height of the pelvis brings the hand there."""
    arm, people, home = arm_of(cell), people_of(cell), np.array(cell.robot.home_q)
    at_tool = np.array([0.0, 0.3, 0.58])
    q = human.reach("r", at_tool, human.rest_posture(*cell.human.home), cell.body).q
    sizes = np.tile(cell.body, (3, 1))
    sizes[:, PELVIS_Z] += (0.45, 0.0, -0.3)
    gaps = [
        clearance(arm, people, home, q[None], NO_PEDESTRIANS, size[None]).people_m
        for size in sizes
    ]
    assert gaps[0] > 0.1 and gaps[1] < 0.0 and gaps[2] > 0.1
    height = np.full(60, -0.3)
    height[0] = 0.45
    run = run_of(np.tile(q, (60, 1)), pelvis_z=height)
    work = HumanMotionConfig(motion="recorded", recorded=(run,), loop=False)
    batch = batch_of(cell, work, start="uniform")
    at_home = (batch.state.q == home).all(axis=1)
    np.testing.assert_allclose(batch.state.clear[at_home, 0], gaps[0])
    stand(batch)
    assert at_home.sum() > 3
    assert (batch.state.outcome[at_home] == OUTCOMES.index("collision")).all()


def test_at_the_table_moves_a_run_as_one_piece(cell: Cell) -> None:
    run = run_of(working(200), pelvis_z=np.linspace(0.0, -0.1, 200))
    there = at_the_table(run, cell)
    np.testing.assert_array_equal(there.q[:, 3:], run.q[:, 3:])
    np.testing.assert_array_equal(there.pelvis_z, run.pelvis_z)
    turn = there.q[:, 2] - run.q[:, 2]
    np.testing.assert_allclose(turn, turn[0], atol=1e-12)
    c, s = np.cos(turn[0]), np.sin(turn[0])
    paths = (run.q[:, :2] - run.q[0, :2]) @ np.array([[c, s], [-s, c]])
    np.testing.assert_allclose(there.q[:, :2] - there.q[0, :2], paths, atol=1e-9)


@pytest.mark.parametrize("turned", [0.0, 2.0, -2.8])
def test_at_the_table_the_person_faces_it_and_comes_as_near_as_a_worker(
    cell: Cell, turned: float
) -> None:
    q = working(200)
    q[:, 2] += turned
    q[:, :2] += 7.0
    there = at_the_table(run_of(q), cell).q
    home_x, _, yaw = cell.human.home
    assert np.median(there[:, 2]) == pytest.approx(yaw)
    assert np.median(there[:, 0]) == pytest.approx(home_x)
    assert there[:, 1].min() == pytest.approx(cell.human.y_min)


def test_segments_of_the_library_begin_and_end_in_their_postures_at_rest(cell: Cell) -> None:
    batch = batch_of(cell, HumanMotionConfig(), 8)
    people, state = batch.world.people, batch.state.people
    state.move[:] = 0
    for k in range(6):
        begin = state.start[:, :, k]
        end = begin + state.duration[:, :, k] + state.segments.stop[:, :, k, 1]
        assert (end <= state.start[:, :, k + 1]).all()
        for when, keyframe in ((begin, k), (end, k + 1)):
            batch.state.outcome[:] = OUTCOMES.index("running")
            state.clock[:] = when - batch.arm.dt
            stand(batch)
            posture = people.postures[state.chosen[:, 0, keyframe]]
            np.testing.assert_allclose(state.q[:, 0], posture, atol=1e-5)
            np.testing.assert_allclose(state.qd, 0.0, atol=1e-4)


def test_library_people_of_all_sizes_are_drawn(cell: Cell) -> None:
    batch = batch_of(cell, HumanMotionConfig(), 80, people=("worker", "worker"))
    people, state = batch.world.people, batch.state.people
    assert len(people.bodies) == len(set(state.body.ravel())) == 6
    assert (state.body[:, 0] != state.body[:, 1]).mean() > 0.5
    np.testing.assert_array_equal(state.size, people.bodies[state.body])


def test_kernels_are_compiled_once_whatever_people_do(cell: Cell) -> None:
    kinds = {
        str(typeof(people_of(cell, work)))
        for work in (
            None,
            HumanMotionConfig(motion="library"),
            HumanMotionConfig(motion="reaches"),
        )
    }
    assert len(kinds) == 1


def test_sizes_that_are_asked_for_are_the_only_ones(cell: Cell) -> None:
    large = percentile_body(95.0)
    batch = batch_of(cell, HumanMotionConfig(bodies=(large,)), 8)
    expected = np.tile(large.vector(cell.floor_z), (8, 1, 1))
    np.testing.assert_array_equal(batch.state.people.size, expected)
    assert expected[0, 0, PELVIS_Z] > cell.body[PELVIS_Z] + 0.05


def test_same_seed_is_the_same_motion_and_another_seed_is_not(cell: Cell) -> None:
    paths = []
    for seed in (1, 1, 2):
        batch = batch_of(cell, HumanMotionConfig(seed=seed), 6, start_clearance_m=-10.0)
        start = batch.state.people.q.copy()
        stand(batch, 20)
        paths.append(np.stack([start, batch.state.people.q]))
    np.testing.assert_array_equal(paths[0], paths[1])
    assert not np.array_equal(paths[0], paths[2])


def test_without_augmentation_segments_last_as_long_as_demonstrated(cell: Cell) -> None:
    batch = batch_of(cell, HumanMotionConfig(augmentation=False), 12)
    shared, state = batch.world.people.primitive_library, batch.state.people
    assert not state.clock.any() and not state.segments.stop.any()
    for e in range(12):
        n = int(state.n_moves[e, 0])
        usual = np.exp(shared.duration[state.segments.primitive[e, 0, :n], 0])
        np.testing.assert_allclose(state.duration[e, 0, :n], usual)
        rests = np.diff(state.start[e, 0, :n]) - state.duration[e, 0, : n - 1]
        np.testing.assert_allclose(rests, 0.5)


def test_with_augmentation_segments_vary_pause_and_begin_anywhere(cell: Cell) -> None:
    state = batch_of(cell, HumanMotionConfig(), 12).state.people
    assert len(np.unique(state.clock)) == 12
    assert 0.02 < (state.segments.stop[:, 0, :8, 1] > 0.0).mean() < 0.5
    shared = batch_of(cell, HumanMotionConfig(), 1).world.people.primitive_library
    usual = np.exp(shared.duration[state.segments.primitive[:, 0, :8], 0])
    assert (np.abs(state.duration[:, 0, :8] / usual - 1.0) > 0.01).mean() > 0.5


@pytest.mark.parametrize(
    ("settings", "field"),
    [
        ({"motion": "dance"}, "motion"),
        ({"yielding": -0.1}, "yielding"),
        ({"yielding": 1.5}, "yielding"),
        ({"yielding": float("nan")}, "yielding"),
        ({"pace": 0.0}, "pace"),
        ({"pace": -1.0}, "pace"),
        ({"pace": float("inf")}, "pace"),
        ({"motion": "recorded"}, "recorded"),
        ({"bodies": ()}, "bodies"),
    ],
)
def test_settings_that_cannot_be_are_refused_by_name(
    settings: dict[str, object], field: str
) -> None:
    with pytest.raises(InvalidInput) as caught:
        HumanMotionConfig(**settings)  # type: ignore[arg-type]
    assert caught.value.field == field


def test_the_asked_share_of_people_is_not_there_and_is_never_touched() -> None:
    settings = PickSettings(people=("worker",) * 2, work=HumanMotionConfig(absent=0.35))
    batch = PickBatch(load_cell(), 400, 5, settings)
    batch.reset()
    absent = batch.state.people.track == ABSENT
    assert abs(absent.mean() - 0.35) < 4.0 * np.sqrt(0.35 * 0.65 / 800)
    rest, alone = np.zeros((400, 5), dtype=np.float32), absent.all(axis=1)
    for _ in range(200):
        batch.step(rest, auto_reset=False, features=False)
    assert alone.sum() > 20
    assert (batch.state.outcome[alone] != COLLISION).all()
    assert (batch.state.outcome[~alone] == COLLISION).mean() > 0.1
    assert (batch.state.people.q[absent] == batch.world.people.no_person).all()


def test_an_absent_person_looks_like_an_empty_cell() -> None:
    away = PickBatch(load_cell(), 4, 5, PickSettings(work=HumanMotionConfig(absent=1.0)))
    empty = PickBatch(load_cell(), 4, 5, PickSettings(people=()))
    person = slice(LAYOUT["human_q"].start, LAYOUT["human_qd"].stop)
    np.testing.assert_allclose(away.reset()[:, person], empty.reset()[:, person])


def test_people_at_rest_stand_still_for_a_while_in_the_posture_they_have() -> None:
    work = HumanMotionConfig(at_rest=1.0)
    batch = PickBatch(load_cell(), 60, 7, PickSettings(time_limit_s=30.0, work=work))
    batch.reset()
    still = np.zeros((60, 5), dtype=np.float32)
    stands, moves = np.zeros(60), np.zeros(60)
    for _ in range(590):
        q = batch.state.people.q[:, 0].copy()
        live = batch.state.outcome == 0
        batch.step(still, auto_reset=False, features=False)
        moved = (batch.state.people.q[:, 0] != q).any(axis=1)
        rests = ~moved & ~batch.state.people.qd[:, 0].any(axis=1)
        stands, moves = stands + 0.05 * (live & rests), moves + 0.05 * (live & moved)
    whole = batch.state.outcome != 2
    assert whole.sum() > 20
    assert (stands[whole] >= 4.9).all()
    assert np.median(moves[whole]) > 2.0


def test_speeds_of_people_are_drawn_between_the_two_paces() -> None:
    work = HumanMotionConfig(pace=0.6, pace_max=2.0)
    batch = PickBatch(load_cell(), 400, 7, PickSettings(work=work))
    batch.reset()
    pace = batch.state.people.pace[:, 0]
    assert 0.6 <= pace.min() < 0.65 and 1.8 < pace.max() <= 2.0
    assert np.median(pace) == pytest.approx(0.6 + 1.4 / 4, abs=0.06)
    with pytest.raises(InvalidInput, match="pace_max"):
        HumanMotionConfig(pace=1.0, pace_max=0.5)


@pytest.mark.parametrize("motion", ["library", "reaches"])
def test_as_many_postures_are_drawn_as_stated(cell: Cell, motion: MotionSource) -> None:
    usual, few = (
        people_of(cell, HumanMotionConfig(motion=motion, variants=variants))
        for variants in (None, 2)
    )
    assert (few.of_station[..., 1] == 2).all()
    stated = HumanMotionConfig(motion=motion, variants=int(usual.of_station[0, 0, 0, 1]))
    np.testing.assert_array_equal(people_of(cell, stated).postures, usual.postures)


@pytest.mark.parametrize("variants", [0, -1, 2.5, True, float("nan")])
def test_no_other_numbers_of_postures_are_taken(variants: int) -> None:
    with pytest.raises(InvalidInput, match="variants = .* at least 1"):
        HumanMotionConfig(variants=variants)


def test_a_short_run_is_played_forward_and_backward() -> None:
    run = run_of(working(40))
    looped = back_and_forth(run, 5.0)
    assert looped.times[-1] >= 5.0
    assert (np.diff(looped.times) > 0.0).all()
    n = len(run.times)
    np.testing.assert_array_equal(looped.q[:n], run.q)
    np.testing.assert_array_equal(looped.q[n : 2 * n - 1], run.q[-2::-1])
    step = np.abs(np.diff(run.q, axis=0)).max()
    assert np.abs(np.diff(looped.q, axis=0)).max() <= step + 1e-12
    assert back_and_forth(run, 0.5 * run.times[-1]) is run
