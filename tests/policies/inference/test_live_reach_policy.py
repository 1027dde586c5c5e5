import numpy as np
import pytest
from numpy.typing import NDArray

from app.live import commands
from app.live.commands import SetPolicy, SetSafety
from app.live.reach.commands import SetInferenceMode
from app.live.reach.controller import TIME_LIMIT_S, ReachController
from app.live.reach.world import LiveReachWorld
from app.policies.checkpoints import checkpoint as formats
from app.policies.inference.controllers import RolloutController, controller_of
from app.policies.inference.live_reach_policy import TrainedReachPolicy
from app.policies.inference.reach_policy import ReachPolicy
from app.policies.inference.rollout import NO_CONSTRAINT
from app.sim.cells.cell import load_cell
from app.sim.reach.batch import ReachBatch, ReachSettings
from app.sim.robot.actions import ActionSettings
from app.sim.safety.layer import SafetySettings
from tests.policies.untrained import untrained_reach

CELL = load_cell("shared-workspace")


@pytest.fixture(scope="module")
def policy() -> ReachPolicy:
    return ReachPolicy(untrained_reach(width=32))


def test_policy_without_targets_cannot_be_interpolated() -> None:
    live = TrainedReachPolicy(ReachPolicy(untrained_reach(width=32, goals="box")))
    assert live.inference_modes == (
        "direct",
        "distance-weighted",
        "direct-rollout",
        "distance-weighted-rollout",
    )


@pytest.mark.parametrize(("view", "direct"), [("features", 1), ("people-set", 4)])
def test_snapshot_says_how_many_people_the_policy_observes(view: str, direct: int) -> None:
    policy = ReachPolicy(untrained_reach(width=32, observation=view))
    world = LiveReachWorld(CELL, TrainedReachPolicy(policy), seed=1)
    for mode, observed in (("direct", direct), ("distance-weighted", 4)):
        world.apply(SetInferenceMode(inference_mode=mode))
        assert world.snapshot().observed_people == observed
    assert LiveReachWorld(CELL, None, seed=1).snapshot().observed_people is None


def test_snapshot_names_time_and_inputs_outside_the_training_range_of_the_decision() -> None:
    untrained = untrained_reach(width=32)
    behind = {"low": [-9.0, -9.0, -9.0, -9.0, 0.0], "high": [9.0, -8.0, 9.0, 9.0, 9.0]}
    manifest = {**untrained.manifest, "trained_range": {"human": behind}}
    policy = ReachPolicy(formats.load(manifest, untrained.tensors))
    world = LiveReachWorld(CELL, TrainedReachPolicy(policy), seed=1)
    world.apply(SetInferenceMode(inference_mode="direct"))
    world.apply(commands.AddPerson())
    world.step()
    direct = world.snapshot()
    [one] = direct.outside
    nearest = [person.nearest for person in direct.people].index(True)
    assert (one.field, one.high) == (f"people[{nearest}].y", -8.0)
    assert direct.decided_s == direct.t_s > 0.0
    world.apply(SetInferenceMode(inference_mode="distance-weighted"))
    fields = [one.field for one in world.snapshot().outside]
    assert fields == ["people[0].y", "people[1].y"]
    for id in (0, 1):
        world.apply(commands.RemovePerson(person=id))
    assert [one.field for one in world.snapshot().outside] == ["people"]
    world.apply(SetPolicy(checkpoint=None))
    after = world.snapshot()
    assert (after.outside, after.decided_s) == ((), None)


def test_live_state_is_seen_as_the_batch_sees_it(policy: ReachPolicy) -> None:
    live = TrainedReachPolicy(policy)
    batch = ReachBatch(CELL, 1, 11, ReachSettings(observation=policy.view))
    batch.reset()
    for _ in range(5):
        batch.step(np.full((1, 6), 0.3, dtype=np.float32))
    world = LiveReachWorld(CELL, live, seed=1)
    robot, driver = world.robot, ReachController(CELL, live)
    state = batch.state
    robot.q, robot.qd, robot.qdd = state.q[0], state.qd[0], state.qdd[0]
    for mode in live.inference_modes:
        driver.inference_mode = mode
        act = driver.act(
            robot,
            state.people.walkers.rows[0],
            state.goal[0],
            float(state.clear[0, 0]),
            float(state.time_left[0]),
            float(state.elapsed[0]),
            None,
        )
        assert np.allclose(act, controller_of(policy, mode).acts(batch)[0], atol=1e-6)


class Noting(TrainedReachPolicy):
    """Record the observed times."""

    def __init__(self, actor: ReachPolicy) -> None:
        super().__init__(actor)
        self.times: list[tuple[float, float]] = []

    def acts(
        self, batch: ReachBatch, mode: str, safety: SafetySettings | None
    ) -> NDArray[np.float32]:
        self.times.append((float(batch.state.elapsed[0]), float(batch.state.time_left[0])))
        return super().acts(batch, mode, safety)


@pytest.mark.parametrize(("on", "measured"), [(True, True), (True, False), (False, True)])
def test_the_rollout_knows_the_active_safety_layer(
    policy: ReachPolicy, on: bool, measured: bool
) -> None:
    live = TrainedReachPolicy(policy)
    world = LiveReachWorld(CELL, live, seed=1)
    world.apply(SetInferenceMode(inference_mode="direct-rollout"))
    world.apply(SetSafety(on=on, use_measured_velocity=measured))
    controller = live._controllers["direct-rollout"]
    assert isinstance(controller, RolloutController)
    assert (controller.constraint != NO_CONSTRAINT) == (on and measured)


def test_under_the_layer_remaining_time_is_constant_and_elapsed_time_true(
    policy: ReachPolicy,
) -> None:
    live = Noting(policy)
    world = LiveReachWorld(CELL, live, seed=1)
    world.apply(SetInferenceMode(inference_mode="direct"))
    live.times.clear()
    while world.snapshot().status == "moving" and len(live.times) < 90:
        world.step()
    elapsed, left = np.array(live.times).T
    assert len(elapsed) > 60
    np.testing.assert_allclose(np.diff(elapsed), CELL.robot.dt, atol=1e-9)
    assert (left == TIME_LIMIT_S).all()


def test_policy_moves_the_robot_of_a_live_cell_with_any_number_of_people(
    policy: ReachPolicy,
) -> None:
    live = TrainedReachPolicy(policy)
    world = LiveReachWorld(CELL, None, seed=1)
    world.apply(SetPolicy(checkpoint=None).with_loaded(live))
    shown = world.snapshot()
    assert (shown.checkpoint, shown.reach.inference_mode) == (
        live.checkpoint,
        "interpolated-rollout",
    )
    assert shown.reach.inference_modes == live.inference_modes
    world.apply(commands.AddPerson())
    world.apply(SetInferenceMode(inference_mode="distance-weighted-interpolated"))
    world.step()
    for id in (0, 1):
        world.apply(commands.RemovePerson(person=id))
        world.step()
    after = world.snapshot()
    assert after.people == ()
    assert not np.array_equal(after.robot_q, shown.robot_q)
    assert after.elapsed_ms > 0.0


def test_robot_executes_actions_by_the_rule_of_its_policy(policy: ReachPolicy) -> None:
    smooth = TrainedReachPolicy(ReachPolicy(untrained_reach(width=32, degree=3)))
    world = LiveReachWorld(CELL, smooth, seed=1)
    rules = [world.robot.action]
    for chosen in (None, smooth, TrainedReachPolicy(policy)):
        world.apply(SetPolicy(checkpoint=None).with_loaded(chosen))
        rules.append(world.robot.action)
    assert rules == [ActionSettings(degree=n) for n in (3, 2, 3, 2)]


def test_goals_jump_among_the_targets_unless_the_policy_is_interpolated(
    policy: ReachPolicy,
) -> None:
    world = LiveReachWorld(CELL, TrainedReachPolicy(policy), seed=1)
    on_target = []
    for mode in ("direct", "interpolated"):
        world.apply(SetInferenceMode(inference_mode=mode))
        world._goal.jump()
        on_target.append(world.snapshot().reach.on_target)
    assert on_target == [True, False]
