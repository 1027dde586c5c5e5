"""The batched scenario: determinism, limits, goals, start rules, ends and rewards."""

from dataclasses import replace

import numpy as np
import pytest

from app.errors import InvalidInput, SimulationError
from app.sim.cell_validation.checks import check_cell
from app.sim.cells.cell import Cell, load_cell
from app.sim.collision.contact import clearance
from app.sim.pick.batch import OUTCOMES
from app.sim.reach.batch import ReachBatch, ReachSettings, stated_rules, with_workplace
from app.sim.robot.actions import ActionSettings
from tests.sim.driven_batches import check_limits, check_rows, random_actions, straight
from tests.sim.reach.kernels.test_reward import PROGRESS

SUCCESS, COLLISION, TIMEOUT, UNFEASIBLE = range(1, 5)
CROWD = ("worker", "walker", "constant", "fixed-speed")


@pytest.fixture(scope="module")
def cell() -> Cell:
    return load_cell("shared-workspace")


def run_to_the_end(batch: ReachBatch) -> np.ndarray:
    """Hold still until every episode has ended; return how."""
    batch.reset()
    still = np.zeros((batch.n_envs, 6), dtype=np.float32)
    while (batch.state.outcome == 0).any():
        batch.step(still, auto_reset=False, features=False)
    return batch.state.outcome


@pytest.mark.parametrize("people", [("walker",), CROWD])
def test_rows_do_not_depend_on_how_many_there_are(cell: Cell, people: tuple[str, ...]) -> None:
    settings = ReachSettings(people=people, start="authors")
    few, many = ReachBatch(cell, 3, 5, settings, 4), ReachBatch(cell, 9, 5, settings)
    check_rows(few, many, slice(4, 7), 600)


def test_same_seed_gives_the_same_bits_and_another_seed_does_not(cell: Cell) -> None:
    first, second = (ReachBatch(cell, 4, seed, ReachSettings()) for seed in (5, 6))
    start = first.reset().copy()
    assert not np.array_equal(start, second.reset())
    np.testing.assert_array_equal(start, second.reset(seed=5))


@pytest.mark.parametrize("degree", [2, 3])
def test_limits_hold_through_whole_episodes(cell: Cell, degree: int) -> None:
    settings = ReachSettings(action=ActionSettings(degree=degree))
    check_limits(ReachBatch(cell, 64, 5, settings), 300)


def test_robot_starts_at_home_and_at_rest(cell: Cell) -> None:
    batch = ReachBatch(cell, 50, 7, ReachSettings())
    batch.reset()
    np.testing.assert_array_equal(batch.state.q, np.tile(cell.robot.home_q, (50, 1)))
    assert not batch.state.qd.any() and (batch.state.time_left == 5.0).all()


def test_grid_goals_are_drawn_uniformly_from_the_54_targets(cell: Cell) -> None:
    batch = ReachBatch(cell, 20_000, 9, ReachSettings(people=()))
    batch.reset()
    counts = np.bincount(batch.state.target, minlength=54)
    assert len(counts) == 54
    np.testing.assert_allclose(counts / 20_000, 1 / 54, atol=0.005)
    targets = cell.goal_region.targets()
    np.testing.assert_array_equal(batch.state.goal, targets[batch.state.target])


def test_box_goals_fill_the_box(cell: Cell) -> None:
    batch = ReachBatch(cell, 5000, 9, ReachSettings(people=(), goals="box"))
    batch.reset()
    low, high = np.array([-0.5, 0.6, 0.1]), np.array([0.5, 1.0, 0.5])
    share = (batch.state.goal - low) / (high - low)
    assert share.min() >= 0.0 and share.max() <= 1.0
    np.testing.assert_allclose(share.mean(axis=0), 0.5, atol=0.02)
    assert (batch.state.target == -1).all()


def test_given_goals_hold_until_the_episode_ends(cell: Cell) -> None:
    batch = ReachBatch(cell, 3, 9, ReachSettings(people=(), observation="state"))
    batch.reset()
    goals = np.array([[0.1, 0.7, 0.2], [0.3, 0.9, 0.4]])
    obs = batch.set_goals(np.array([0, 2]), goals)
    np.testing.assert_allclose(obs[[0, 2], 17:], goals, rtol=1e-6)
    for _ in range(200):
        batch.step(straight(batch), auto_reset=False)
    np.testing.assert_array_equal(batch.state.goal[[0, 2]], goals)
    assert (batch.state.outcome == SUCCESS).all()


def test_straight_moves_reach_every_target_in_an_empty_cell(cell: Cell) -> None:
    batch = ReachBatch(cell, 300, 9, ReachSettings(people=()))
    batch.reset()
    for _ in range(250):
        batch.step(straight(batch), auto_reset=False, features=False)
    won = batch.state.outcome == SUCCESS
    assert won.all(), set(batch.state.target[~won])
    assert (batch.state.distance < 0.1).all()


def test_starts_keep_the_required_clearance(cell: Cell) -> None:
    batch = ReachBatch(cell, 2000, 7, ReachSettings())
    batch.reset()
    assert (batch.state.clear[:, 0] >= 0.05).all()
    assert 0.02 < (batch.state.n_redrawn > 0).mean() < 0.12


@pytest.mark.parametrize("rule", ["uniform", "authors"])
def test_other_rules_let_people_start_in_contact(cell: Cell, rule: str) -> None:
    batch = ReachBatch(cell, 2000, 7, ReachSettings(start=rule))
    batch.reset()
    touching = batch.state.clear[:, 0] <= 0.0
    assert 0.02 < touching.mean() < 0.1 and not batch.state.n_redrawn.any()
    result = batch.step(np.zeros((2000, 6), dtype=np.float32), auto_reset=False)
    assert (result.ended[touching] == COLLISION).all()


def test_collision_ends_the_episode_unless_it_shall_go_on(cell: Cell) -> None:
    settings = ReachSettings(start="uniform")
    short = ReachBatch(cell, 300, 7, settings)
    ends = run_to_the_end(short).copy()
    long = ReachBatch(cell, 300, 7, replace(settings, collision_ends=False))
    np.testing.assert_array_equal(run_to_the_end(long), ends)
    hit = ends == COLLISION
    assert hit.any() and (short.state.time_left[hit] > 0.0).any()
    assert (long.state.time_left <= 1e-9).all()
    assert (long.state.touched[hit] > 0).all() and not long.state.touched[~hit].any()


def test_goal_reached_after_a_collision_is_no_success(cell: Cell) -> None:
    settings = ReachSettings(start="uniform", collision_ends=False, weights=PROGRESS)
    batch = ReachBatch(cell, 400, 7, settings)
    batch.reset()
    late = np.zeros(400, dtype=bool)
    for _ in range(250):
        result = batch.step(straight(batch), auto_reset=False, features=False)
        now = (result.ended == COLLISION) & (batch.state.distance < 0.1)
        late |= now & (batch.state.time_left > 0.1)
        assert (result.rew[now] < 1.0).all()
    assert late.any()
    assert not batch.state.touched[batch.state.outcome == SUCCESS].any()


def test_periods_without_contact_are_clear_in_between_too(cell: Cell) -> None:
    batch = ReachBatch(cell, 30, 12, ReachSettings(people=("walker", "fixed-speed")))
    batch.reset()
    state, dt, none = batch.state, cell.robot.dt, np.zeros((0, 18))
    for _ in range(120):
        q, qd, walkers = state.q.copy(), state.qd.copy(), state.people.cylinders.copy()
        batch.step(straight(batch), auto_reset=False, features=False)
        for e in np.flatnonzero((state.outcome == 0) & (state.clear[:, 0] < 0.1)):
            for x in (0.25, 0.5, 0.75):
                t = x * dt
                at = q[e] + t * qd[e] + t * t * (state.qd[e] - qd[e]) / (2 * dt)
                crowd = walkers[e] + x * (state.people.cylinders[e] - walkers[e])
                found = clearance(batch.arm, batch.world.people, at, none, crowd)
                assert min(found.people_m, found.cell_m, found.self_m) > 0.0
    assert (state.outcome == COLLISION).any() and (state.outcome == SUCCESS).any()


def test_thesis_reward_costs_distance_and_acceleration(cell: Cell) -> None:
    batch = ReachBatch(cell, 5, 3, ReachSettings(people=()))
    batch.reset()
    for act in random_actions(20, batch):
        qd0 = batch.state.qd.copy()
        rew = batch.step(act, auto_reset=False).rew
        c = (batch.state.qd - qd0) / (2.0 * cell.robot.dt)
        expected = -batch.state.distance - 0.1 * np.linalg.norm(c, axis=1)
        np.testing.assert_allclose(rew, expected, rtol=1e-5)


def test_one_step_bounds_can_end_unfeasible(cell: Cell) -> None:
    action = ActionSettings(bounds="one-step", meaning="coefficient")
    batch = ReachBatch(cell, 20, 3, ReachSettings(people=(), time_limit_s=25.0, action=action))
    batch.reset()
    push = np.ones((20, 6), dtype=np.float32)
    push[:, 1:] = 0.0
    for _ in range(400):
        batch.step(push, auto_reset=False, features=False)
    assert (batch.state.outcome == UNFEASIBLE).any()


def test_time_up_is_a_time_out(cell: Cell) -> None:
    batch = ReachBatch(cell, 4, 3, ReachSettings(people=(), time_limit_s=0.1))
    assert (run_to_the_end(batch) == OUTCOMES.index("timeout")).all()
    np.testing.assert_allclose(batch.state.elapsed, 0.1)


def test_workplace_of_a_worker_is_a_sound_cell(cell: Cell) -> None:
    assert check_cell(with_workplace(cell)) == []
    batch = ReachBatch(cell, 200, 3, ReachSettings(people=CROWD))
    batch.reset()
    assert batch.state.people.q.shape[1] == 1 and batch.state.people.cylinders.shape[1] == 3


def test_worker_reaches_into_the_goals(cell: Cell) -> None:
    batch = ReachBatch(cell, 200, 3, ReachSettings(people=("worker",)))
    batch.reset()
    for _ in range(250):
        batch.step(straight(batch), auto_reset=False, features=False)
    assert (batch.state.outcome == COLLISION).mean() > 0.1


def test_stated_rules_name_everything_that_moves_results(cell: Cell) -> None:
    stated = stated_rules(cell, ReachSettings(start="authors", collision_ends=False))
    assert stated["start"] == "authors" and stated["walk"]["apart"] == 0.5
    assert stated["collision_ends"] is False and stated["people"] == ["walker"]
    assert stated_rules(cell, ReachSettings())["start_clearance_m"] == 0.05


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("start", "nowhere"),
        ("goals", "sphere"),
        ("observation", "pixels"),
        ("time_limit_s", 0.0),
        ("time_limit_s", float("nan")),
        ("start_clearance_m", float("inf")),
    ],
)
def test_wrong_setting_is_refused_with_its_rule(field: str, value: object) -> None:
    with pytest.raises(InvalidInput, match="must "):
        ReachSettings(**{field: value})


def test_cell_without_goals_is_refused() -> None:
    with pytest.raises(InvalidInput, match="goal_region"):
        ReachBatch(load_cell("pick-and-place"), 1, 0, ReachSettings())


def test_unknown_and_too_many_people_are_refused(cell: Cell) -> None:
    for people in (("ghost",), ("walker",) * 5):
        with pytest.raises(InvalidInput, match="people"):
            ReachBatch(cell, 1, 0, ReachSettings(people=people))


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_numbers_that_are_not_finite_are_errors(cell: Cell, value: float) -> None:
    batch = ReachBatch(cell, 1, 0, ReachSettings())
    batch.reset()
    with pytest.raises(SimulationError, match="finite"):
        batch.step(np.full((1, 6), value, dtype=np.float32))
    with pytest.raises(SimulationError, match="finite"):
        batch.set_goals(np.array([0]), np.full((1, 3), value))


@pytest.mark.parametrize("shape", [(1, 6), (2, 5), (12,), (3, 6)])
def test_actions_of_another_shape_are_refused(cell: Cell, shape: tuple[int, ...]) -> None:
    batch = ReachBatch(cell, 2, 0, ReachSettings())
    batch.reset()
    with pytest.raises(InvalidInput, match="shape"):
        batch.step(np.zeros(shape, dtype=np.float32))


def test_goals_for_cells_that_are_not_there_are_refused(cell: Cell) -> None:
    batch = ReachBatch(cell, 2, 0, ReachSettings())
    batch.reset()
    for rows, goals in (([2], np.zeros((1, 3))), ([-1], np.zeros((1, 3))), ([0], np.zeros(3))):
        with pytest.raises(InvalidInput):
            batch.set_goals(np.array(rows), goals)
