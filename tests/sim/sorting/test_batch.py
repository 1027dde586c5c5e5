"""The batch of sorting tasks keeps its promises over thousands of random attempts."""

from collections import Counter

import numpy as np
import pytest

from app.errors import InvalidInput
from app.sim.cells.cell import load_cell
from app.sim.sorting.batch import (
    OUTCOMES,
    SortingBatch,
    SortingSettings,
    apply,
    batch_in,
    fail_of,
    observe,
    shape_of,
    valid_moves,
)
from app.sim.sorting.state import SortingShape, SortingState, check_state, code_counts, missing

SHAPE = SortingShape(n_slots=6, n_colours=3, n_sizes=2)
SAFE = np.zeros(6)
RISKY = np.array([0.0, 0.1, 0.2, 0.3, 0.4, 0.25])
LIVELY = SortingSettings(
    disturbed_share=0.4,
    solved_episodes=0.3,
    solved_share=0.5,
    human_rate=0.2,
    localisation_rate=0.2,
    random_map_share=0.5,
)


def batch_of(
    n: int, settings: SortingSettings | None = None, fail: np.ndarray = SAFE, seed: int = 5
) -> SortingBatch:
    """A batch that has started."""
    batch = SortingBatch(SHAPE, fail, n, seed, settings)
    batch.reset()
    return batch


def valid_acts(batch: SortingBatch, rng: np.random.Generator) -> np.ndarray:
    """A random valid move in every environment."""
    return (batch.masks() * rng.random((batch.n_envs, batch.shape.n_actions))).argmax(axis=1)


def states(batch: SortingBatch) -> list[SortingState]:
    return [batch.state_of(e) for e in range(batch.n_envs)]


def counts(batch: SortingBatch) -> np.ndarray:
    """Objects of each code, a row per task."""
    found = [
        code_counts(s.clutter, SHAPE) + code_counts(s.towers, SHAPE) for s in states(batch)
    ]
    return np.array(found)[:, 1:]


def test_objects_are_conserved_and_towers_have_no_gaps() -> None:
    settings = SortingSettings(localisation_rate=0.3, disturbed_share=0.5, horizon_factor=100.0)
    batch = batch_of(64, settings, RISKY)
    before, rng = counts(batch), np.random.default_rng(1)
    for _ in range(100):
        batch.step(rng.integers(SHAPE.n_actions, size=64), auto_reset=False)
        np.testing.assert_array_equal(batch.envs.heights, (batch.envs.towers != 0).sum(axis=2))
    np.testing.assert_array_equal(counts(batch), before)
    for state in states(batch):
        check_state(state, SHAPE)


def test_masks_mark_exactly_the_moves_that_change_something() -> None:
    batch = batch_of(32, SortingSettings(disturbed_share=1.0))
    start = states(batch)
    masks = batch.masks().copy()
    for action in range(SHAPE.n_actions):
        for e, state in enumerate(start):
            batch.put(e, state)
        batch.step(np.full(32, action), auto_reset=False)
        changed = [
            (now.clutter != was.clutter).any() or (now.towers != was.towers).any()
            for now, was in zip(states(batch), start, strict=True)
        ]
        np.testing.assert_array_equal(masks[:, action], changed)
        np.testing.assert_array_equal(batch.envs.moves, changed)


def test_one_state_and_the_rows_agree_on_masks_observations_and_moves() -> None:
    settings = SortingSettings(disturbed_share=0.5, random_map_share=0.5, horizon_factor=100.0)
    batch, rng = batch_of(32, settings), np.random.default_rng(2)
    for _ in range(20):
        start, obs = states(batch), batch.observations().copy()
        acts = valid_acts(batch, rng)
        for e, state in enumerate(start):
            np.testing.assert_array_equal(valid_moves(state, SHAPE), batch.masks()[e])
            np.testing.assert_array_equal(observe(state), obs[e])
            batch.envs.fail[e] = 0.0
        batch.step(acts, auto_reset=False)
        for e, (state, act) in enumerate(zip(start, acts, strict=True)):
            after = apply(state, SHAPE, SHAPE.move_of(int(act)))
            np.testing.assert_array_equal(after.clutter, batch.envs.clutter[e])
            np.testing.assert_array_equal(after.towers, batch.envs.towers[e])
            batch.envs.fail[e] = state.fail
        batch.envs.outcome[:] = OUTCOMES.index("running")


def test_sizes_of_other_settings_count_from_the_next_start_on() -> None:
    batch = batch_of(16)
    batch.settings = SortingSettings(n_objects=3, n_goal=2)
    batch.restart()
    assert (counts(batch).sum(axis=1) == 3).all()
    assert (batch.envs.goal_heights.sum(axis=1) == 2).all()
    with pytest.raises(InvalidInput, match="n_objects = 7 must lie in"):
        batch.settings = SortingSettings(n_objects=7)
    assert batch.settings.n_objects == 3 and (batch.envs.fixed_objects == 3).all()


@pytest.mark.parametrize("envs", [[16], [-1], [True] * 16, [0.0]])
def test_only_environments_that_exist_are_started(envs: list[int]) -> None:
    with pytest.raises(InvalidInput, match="^envs = .* must be"):
        batch_of(16).start(np.array(envs))


def test_picks_fail_as_often_as_their_cells_say() -> None:
    n = 4000
    batch = batch_of(n, SortingSettings(n_objects=6), RISKY)
    for cell, risk in enumerate(RISKY):
        batch.restart()
        batch.step(np.full(n, cell * SHAPE.n_colours), auto_reset=False)
        share = batch.envs.failures.mean()
        assert abs(share - risk) <= 4 * np.sqrt(risk * (1 - risk) / n)
        assert (batch.envs.failures + batch.envs.moves == 1).all()


def test_picks_from_towers_do_not_fail() -> None:
    batch = batch_of(200, SortingSettings(disturbed_share=1.0), np.full(6, 0.99))
    c = batch.envs.heights.argmax(axis=1)
    batch.step(2 * 6 * 3 + c * 3 + (c + 1) % 3, auto_reset=False)
    assert (batch.envs.moves[batch.envs.heights.sum(axis=1) > 0] == 1).all()
    assert not batch.envs.failures.any()


def test_horizon_is_a_time_out_and_a_goal_a_success() -> None:
    batch = batch_of(8, SortingSettings(horizon_factor=2.0))
    stuck = np.full(8, SHAPE.n_actions - 1)
    ends = [batch.step(stuck, auto_reset=False).ended.copy() for _ in range(batch.horizon + 1)]
    assert batch.horizon == 12
    assert not np.any(ends[:11])
    assert (ends[11] == OUTCOMES.index("timeout")).all()
    assert not ends[12].any() and (batch.envs.steps == 12).all()


def test_reaching_the_goal_with_the_last_attempt_is_a_success() -> None:
    batch = batch_of(8, SortingSettings(horizon_factor=1.0 / 6.0, n_objects=4, n_goal=1))
    cells, colours = [], []
    for state in states(batch):
        code = int(state.goal.max())
        cells.append(int(np.flatnonzero(state.clutter == code)[0]))
        colours.append(SHAPE.colour_of(code))
    acts = np.array(cells) * SHAPE.n_colours + np.array(colours)
    assert (batch.step(acts).ended == OUTCOMES.index("success")).all()


def test_a_row_alone_equals_the_row_of_a_batch_bit_for_bit() -> None:
    many, rng = batch_of(5, LIVELY, RISKY), np.random.default_rng(3)
    one = SortingBatch(SHAPE, RISKY, 1, 5, LIVELY, first_env=3)
    one.reset()
    for _ in range(300):
        acts = rng.integers(SHAPE.n_actions, size=5)
        wide, narrow = many.step(acts), one.step(acts[3:4])
        np.testing.assert_array_equal(wide.obs[3], narrow.obs[0])
        assert wide.rew[3] == narrow.rew[0] and wide.ended[3] == narrow.ended[0]
    assert one.envs.episode[0] >= 5


def test_numbers_of_objects_follow_their_triangles() -> None:
    n, k = 20_000, SHAPE.n_slots
    batch = batch_of(n)
    objects = (batch.envs.clutter > 0).sum(axis=1)
    goals = (batch.envs.goal > 0).sum(axis=(1, 2))
    for most, drawn in ((k, objects), *((m, goals[objects == m]) for m in (3, k))):
        for count in range(1, most + 1):
            wanted = (2 * count - 1) / most**2
            share = (drawn == count).mean()
            assert abs(share - wanted) < 4 * np.sqrt(wanted * (1 - wanted) / len(drawn)) + 1e-9


def test_pairs_can_be_fixed() -> None:
    batch = batch_of(50, SortingSettings(n_objects=5, n_goal=2))
    assert ((batch.envs.clutter > 0).sum(axis=1) == 5).all()
    assert ((batch.envs.goal > 0).sum(axis=(1, 2)) == 2).all()


@pytest.mark.parametrize("cell_name", ["sorting-e0", "sorting-e1"])
def test_goals_ask_for_objects_on_their_colours_tower_the_largest_at_the_bottom(
    cell_name: str,
) -> None:
    cell = load_cell(cell_name)
    batch, shape = batch_in(cell, 200, 8), shape_of(cell)
    batch.reset()
    np.testing.assert_array_equal(batch.envs.fail[0], fail_of(cell))
    for e in range(200):
        state = batch.state_of(e)
        check_state(state, shape)
        assert not state.solved and not state.heights.any()
        for colour, tower in enumerate(state.goal):
            codes = tower[tower > 0].tolist()
            assert codes == sorted(codes, reverse=True)
            assert {shape.colour_of(code) for code in codes} <= {colour}


def built(state: SortingState) -> int:
    """Objects that stand as the goal asks, with nothing wrong below them."""
    right = (state.towers == state.goal) & (state.goal > 0)
    return int(np.cumprod(right, axis=1).sum())


def test_curriculum_starts_have_a_share_of_the_goal_done() -> None:
    settings = SortingSettings(solved_episodes=0.4, solved_share=0.5, n_objects=6, n_goal=4)
    starts = states(batch_of(2000, settings))
    done = Counter(built(state) for state in starts)
    assert set(done) == {0, 2}
    assert abs(done[2] / 2000 - 0.4) < 4 * np.sqrt(0.4 * 0.6 / 2000)
    assert all(state.heights.sum() == built(state) for state in starts)


def test_disturbed_starts_have_junk_on_the_towers() -> None:
    starts = states(batch_of(2000, SortingSettings(disturbed_share=0.3)))
    disturbed = [state for state in starts if state.heights.any()]
    assert abs(len(disturbed) / 2000 - 0.3) < 4 * np.sqrt(0.3 * 0.7 / 2000)
    assert any(built(state) > 0 for state in disturbed)
    assert all(not state.solved for state in starts)
    junk = [state for state in disturbed if built(state) < state.heights.sum()]
    assert len(junk) > 0.7 * len(disturbed)


def test_whatever_people_do_the_goal_can_still_be_met() -> None:
    settings = SortingSettings(human_rate=1.0, horizon_factor=100.0, disturbed_share=0.3)
    batch, rng = batch_of(64, settings, RISKY), np.random.default_rng(4)
    goals, objects = set(), set()
    for _ in range(60):
        batch.step(valid_acts(batch, rng))
        for state in states(batch):
            check_state(state, SHAPE)
            assert not missing(state, SHAPE).any()
            objects.add(state.n_objects)
        goals.add(batch.envs.goal[0].tobytes())
    assert len(goals) > 3 and objects >= {2, 3, 4, 5, 6}


def test_people_add_remove_move_and_change_the_goal() -> None:
    settings = SortingSettings(human_rate=1.0, n_objects=4, n_goal=2)
    batch = batch_of(1000, settings)
    start, total = batch.envs.goal.copy(), (batch.envs.clutter > 0).sum(axis=1)
    stuck = np.full(1000, SHAPE.n_actions - 1)
    clutter = batch.envs.clutter.copy()
    batch.step(stuck, auto_reset=False)
    now = (batch.envs.clutter > 0).sum(axis=1) + batch.envs.heights.sum(axis=1)
    moved = (now == total) & (clutter != batch.envs.clutter).any(axis=1)
    asked = (batch.envs.goal != start).any(axis=(1, 2))
    assert (batch.envs.interferences == 1).all()
    for share in ((now > total).mean(), (now < total).mean(), moved.mean(), asked.mean()):
        assert 0.08 < share < 0.33


def test_a_localisation_failure_moves_another_object_and_says_so() -> None:
    settings = SortingSettings(localisation_rate=1.0, n_objects=5)
    batch = batch_of(500, settings)
    before = batch.envs.clutter.copy()
    cells = np.array([np.flatnonzero(row)[2] for row in before])
    batch.step(cells * SHAPE.n_colours, auto_reset=False)
    envs = np.arange(500)
    np.testing.assert_array_equal(batch.envs.clutter[envs, cells], before[envs, cells])
    gone = (before != 0) & (batch.envs.clutter == 0)
    assert (gone.sum(axis=1) == 1).all() and (batch.envs.failures == 1).all()
    place = np.array(
        [
            np.flatnonzero(np.flatnonzero(b) == np.flatnonzero(g)[0])[0]
            for b, g in zip(before, gone, strict=True)
        ]
    )
    assert set(place) == {0, 1, 3, 4}


def test_random_maps_replace_the_cells_own_in_their_share_of_episodes() -> None:
    batch = batch_of(1000, SortingSettings(random_map_share=0.5, failure_max=0.2), RISKY)
    own = (batch.envs.fail == RISKY).all(axis=1)
    assert 0.43 < own.mean() < 0.57
    assert batch.envs.fail[~own].max() <= 0.2


def test_a_given_state_starts_again_and_a_changed_one_goes_on() -> None:
    batch, rng = batch_of(2, SortingSettings(horizon_factor=100.0)), np.random.default_rng(6)
    given = states(batch_of(1, SortingSettings(disturbed_share=1.0), RISKY, seed=9))[0]
    for _ in range(3):
        batch.step(valid_acts(batch, rng), auto_reset=False)
    batch.put(0, given)
    batch.change(1, given)
    assert batch.envs.steps.tolist() == [0, 3] and batch.envs.moves.tolist() == [0, 3]
    for e in range(2):
        np.testing.assert_array_equal(observe(batch.state_of(e)), observe(given))


@pytest.mark.parametrize("bad", [1.0, np.nan, -0.1])
def test_a_failure_map_that_no_plan_survives_is_refused(bad: float) -> None:
    fail = SAFE.copy()
    fail[2] = bad
    with pytest.raises(InvalidInput, match="fail"):
        SortingBatch(SHAPE, fail, 1, 0)


@pytest.mark.parametrize("act", [-1, SHAPE.n_actions])
def test_unknown_actions_are_refused(act: int) -> None:
    with pytest.raises(InvalidInput, match="act"):
        batch_of(2).step(np.array([0, act]))


@pytest.mark.parametrize(("n_objects", "n_goal"), [(3, 5), (11, 1), (0, 11), (-1, 0)])
def test_more_objects_than_fit_are_refused(n_objects: int, n_goal: int) -> None:
    settings = SortingSettings(n_objects=n_objects, n_goal=n_goal)
    with pytest.raises(InvalidInput, match="n_objects|n_goal"):
        batch_in(load_cell("sorting-e0"), 1, 0, settings)


@pytest.mark.parametrize(
    ("field", "value", "rule"),
    [
        ("failure_max", 1.5, r"in \[0, 0.99\]"),
        ("failure_max", -0.5, r"in \[0, 0.99\]"),
        ("horizon_factor", float("nan"), "positive"),
        ("horizon_factor", 0.0, "positive"),
        ("human_rate", float("nan"), r"in \[0, 1\]"),
        ("disturbed_share", -0.1, r"in \[0, 1\]"),
    ],
)
def test_settings_out_of_range_are_refused(field: str, value: float, rule: str) -> None:
    with pytest.raises(InvalidInput, match=f"^{field} = .*{rule}"):
        SortingSettings(**{field: value})  # type: ignore[arg-type]
