"""Reach environments in which a contact blocks the arm."""

import numpy as np
import pytest

from app.policies.configs import presets
from app.policies.training.reach import batch_of
from app.sim.cells.cell import load_cell
from app.sim.reach.batch import ReachBatch, ReachSettings
from app.sim.reach.blocked_batch import BlockedReachBatch, new_reach_batch
from app.sim.reach.recipe_rules import BlockedRules
from app.sim.scenario.kernels.episode import COLLISION, RUNNING, SUCCESS, TIMEOUT

DOWN = np.array([0.0, 1.0, 0.0, 0.0, 0.0, 0.0], dtype=np.float32)
"""Action that lowers the upper arm of the UR10 toward the table."""


def batch(preset: str, n_envs: int = 4, seed: int = 3) -> BlockedReachBatch:
    made = batch_of(presets.get(preset), load_cell("shared-workspace"), n_envs, seed)
    assert isinstance(made, BlockedReachBatch)
    made.reset()
    return made


def alone(**settings: object) -> BlockedReachBatch:
    rules = ReachSettings(people=(), collision_ends=False, limits="authors", **settings)
    made = BlockedReachBatch(load_cell("shared-workspace"), 1, 1, rules)
    made.reset()
    return made


@pytest.mark.parametrize(
    ("preset", "cost", "success"),
    [("reach-ddpg-authors", 0.01, 20.0), ("reach-ddpg-thesis", 0.1, 20.0 - 0.05 - 0.1 * 0.5)],
)
def test_the_reward_of_both_recipes(preset, cost, success):
    envs = batch(preset)
    act = np.zeros((4, 6), dtype=np.float32)
    act[:, 0] = [0.5, -1.0, 0.5, 0.0]
    envs.state.distance[:] = [0.05, 0.4, 0.3, 0.2]
    envs._ended[:] = [SUCCESS, RUNNING, RUNNING, TIMEOUT]
    contact = np.array([False, False, True, False])
    wanted = [success, -0.4 - cost, -0.3 - 0.5 * cost - 5.0, -0.2]
    assert envs._rewards(act, contact) == pytest.approx(wanted)


def test_a_period_that_reaches_the_goal_in_contact_is_no_success():
    envs = batch("reach-ddpg-authors", n_envs=1)
    envs.state.distance[:], envs._ended[:] = 0.05, TIMEOUT
    still = np.zeros((1, 6), dtype=np.float32)
    assert envs._rewards(still, np.array([True])) == pytest.approx([-5.05])


def test_a_joint_reaches_any_commanded_speed_within_a_period():
    envs = alone()
    for speed in (1.0, -1.0):
        act = np.full((1, 6), speed, dtype=np.float32)
        envs.step(act)
        assert envs.state.qd[0] == pytest.approx(speed)
    assert envs.arm.limits.q_max == pytest.approx(np.pi * np.array([2, 2, 2, 1, 1, 1]))


def test_the_arm_does_not_enter_the_table_and_gets_free_again():
    envs = alone()
    for _ in range(200):
        result = envs.step(DOWN[None], auto_reset=False)
    at_table = envs.state.q.copy()
    assert envs.state.clear[0].min() > -1e-3
    assert envs.state.touched[0] > 20 and not envs.state.qd.any()
    assert result.rew[0] == pytest.approx(-envs.state.distance[0] - 5.0)
    envs.step(DOWN[None], auto_reset=False)
    np.testing.assert_array_equal(envs.state.q, at_table)
    touched = envs.state.touched[0]
    for _ in range(5):
        envs.step(-DOWN[None], auto_reset=False)
    assert envs.state.q[0, 1] < at_table[0, 1] - 0.05
    assert envs.state.touched[0] <= touched + 1


def test_an_episode_with_a_contact_goes_on_and_counts_as_a_collision():
    envs = alone()
    outcomes = [envs.step(DOWN[None], auto_reset=False).ended[0] for _ in range(250)]
    assert outcomes[:-1] == [RUNNING] * 249 and outcomes[-1] == COLLISION


def test_settings_say_whether_contacts_block():
    cell = load_cell("shared-workspace")
    made = new_reach_batch(cell, 1, 1, ReachSettings(blocked=BlockedRules()))
    assert isinstance(made, BlockedReachBatch)
    assert type(new_reach_batch(cell, 1, 1, ReachSettings())) is ReachBatch


def test_where_nothing_touches_the_motion_is_that_of_other_environments():
    rules = ReachSettings(collision_ends=False, observation="state")
    one = BlockedReachBatch(load_cell("shared-workspace"), 30, 7, rules)
    other = ReachBatch(load_cell("shared-workspace"), 30, 7, rules)
    np.testing.assert_array_equal(one.reset(), other.reset())
    act = np.random.default_rng(5).uniform(-0.2, 0.2, (30, 6)).astype(np.float32)
    for _ in range(60):
        a, b = one.step(act), other.step(act)
    free = one.state.touched == 0
    assert free.sum() > 20
    np.testing.assert_array_equal(a.obs[free], b.obs[free])


def test_goals_take_turns_over_all_targets():
    envs = batch("reach-ddpg-authors", n_envs=60)
    assert envs.state.target.tolist() == [number % 54 for number in range(60)]
    envs.state.episode[:] += 1
    envs.restart()
    assert envs.state.target.tolist() == [number % 54 for number in range(1, 61)]
    goals = envs.world.targets[envs.state.target]
    np.testing.assert_array_equal(envs.state.goal, goals)
    tcp = np.linalg.norm(goals - goals[0], axis=1)
    assert envs.state.distance[54] == pytest.approx(envs.state.distance[0])
    assert tcp.max() > 1.0
