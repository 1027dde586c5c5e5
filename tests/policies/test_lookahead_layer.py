"""Looking ahead under a safety layer that goes by measured velocities: it is held less."""

from dataclasses import replace

import numpy as np
import pytest

from app.policies.checkpoints import pretrained
from app.policies.evaluation.reach.ssm import Comparison
from app.policies.inference.controllers import RolloutController, controller_of
from app.policies.inference.motion_decision import MotionDecider
from app.policies.inference.reach_policy import ReachPolicy
from app.policies.inference.rollout import (
    LONGEST_HORIZON,
    NO_CONSTRAINT,
    SPARE_DISTANCE,
    Layer,
    Lookahead,
    ssm_constraint_of,
)
from app.policies.networks.actor_critic import BASE_WEIGHT
from app.sim.cells.cell import load_cell
from app.sim.people.kernels.pedestrian import GAIT, STILL, VX, VY, X, Y
from app.sim.perception.observed_people import person_from_cylinder
from app.sim.prediction.weights import new_motion_predictor
from app.sim.reach.batch import ReachBatch, ReachSettings
from app.sim.reach.crossings import crossings
from app.sim.reach.kernels.episode import new_work
from app.sim.reach.motion_types import MotionQuestion
from app.sim.reach.rollout.kernels import rollout as played_ways
from app.sim.reach.rollout.kernels.prediction import LONG_MOMENTS, MOMENTS, foretell
from app.sim.robot.kernels.arm import new_robot_pose, place_robot
from app.sim.safety.layer import SafetySettings, safety_settings

CELL = load_cell("shared-workspace")
POLICY = ReachPolicy(pretrained.load("reach"))
MEASURED = replace(safety_settings(CELL), use_measured_velocity=True)
DT = CELL.robot.dt


def standing(*places: tuple[float, float]) -> ReachBatch:
    """Return robots at home, each beside somebody who stands."""
    settings = ReachSettings(people=("walker",), observation="forecast")
    batch = ReachBatch(CELL, len(places), 1, settings)
    batch.reset()
    rows = batch.state.people.walkers.rows
    rows[:, 0, [X, Y]], rows[:, 0, GAIT], rows[:, 0, [VX, VY]] = places, STILL, 0.0
    return batch


def heeded(batch: ReachBatch, layer: Layer) -> list[tuple[float, np.ndarray]]:
    """Return how far people are kept in each cell [m], and the posture found at the goal."""
    network = POLICY.kernel_network
    assert network is not None
    look = played_ways.new_lookahead(batch.arm, network, BASE_WEIGHT, batch.n_envs)
    work, found = new_work(batch.world, batch.state, new_motion_predictor()), []
    look.layer[:] = layer
    for e in range(batch.n_envs):
        n = foretell(batch.world, batch.state, e, LONG_MOMENTS, work, look.foretold)
        played_ways.heed_layer(batch.world, batch.state, e, n, work, look)
        found.append((float(look.kept[0]), look.goal_q.copy()))
    return found


@pytest.mark.parametrize("settings", [None, SafetySettings()])
def test_nothing_is_known_where_people_may_come_from_anywhere(
    settings: SafetySettings | None,
) -> None:
    assert ssm_constraint_of(settings, DT) == NO_CONSTRAINT


def test_what_is_kept_follows_from_what_the_layer_assumes() -> None:
    settings = replace(MEASURED, speed_change=0.5, intrusion_distance=0.05)
    ahead = 0.1 + 0.02 + 0.03
    layer = ssm_constraint_of(settings, 0.02, age=0.03)
    assert layer.ahead == pytest.approx(ahead)
    assert layer.distance == pytest.approx(0.35 + 0.5 * ahead + SPARE_DISTANCE)
    assert ssm_constraint_of(settings, 0.02, age=60.0).ahead == LONGEST_HORIZON


def test_whoever_is_nearer_already_is_left_to_the_layer() -> None:
    layer = ssm_constraint_of(MEASURED, DT)
    near, far = heeded(standing((0.1, 0.95), (0.1, 1.8)), layer)
    assert near[0] == 0.0 and far[0] == layer.distance


def test_a_posture_is_found_at_every_target() -> None:
    targets = POLICY.targets
    assert targets is not None and len(targets) == 54
    batch = standing(*[(-2.0, 2.0)] * 54)
    batch.set_goals(np.arange(54), targets)
    pose = new_robot_pose(batch.arm)
    for goal, (_, posture) in zip(
        targets, heeded(batch, ssm_constraint_of(MEASURED, DT)), strict=True
    ):
        place_robot(batch.arm, posture, pose)
        assert np.linalg.norm(pose.tcp - goal) < 0.1
        assert (batch.arm.limits.q_min <= posture).all() and (
            posture <= batch.arm.limits.q_max
        ).all()


def test_looking_farther_changes_nothing_of_what_is_foretold_sooner() -> None:
    settings = ReachSettings(people=("walker",), observation="forecast")
    told = []
    for moments in (MOMENTS, LONG_MOMENTS):
        batch = ReachBatch(CELL, 40, 7, settings)
        batch.reset()
        network = POLICY.kernel_network
        assert network is not None
        look = played_ways.new_lookahead(batch.arm, network, BASE_WEIGHT, 40)
        work = new_work(batch.world, batch.state, new_motion_predictor())
        for e in range(40):
            foretell(batch.world, batch.state, e, moments, work, look.foretold)
            told.append(look.foretold.places[:MOMENTS, 0].copy())
    np.testing.assert_array_equal(told[:40], told[40:])


def test_people_who_cross_hold_the_robot_less_and_walk_into_it_less() -> None:
    """Twelve of other crossings than those that are evaluated."""
    settings = ReachSettings(action=POLICY.action, observation=POLICY.view)
    comparison = Comparison(CELL, crossings(CELL, 12, seed=77), settings, MEASURED, seed=11)
    direct = controller_of(POLICY, "direct")
    heedless, heeding = (
        comparison.policy(RolloutController(direct, POLICY, layer)).runs
        for layer in (NO_CONSTRAINT, ssm_constraint_of(MEASURED, DT))
    )
    assert heeding.arrived.all() and not heeding.touched_moving.any()
    assert heeding.stopped_s.sum() < 0.5 * heedless.stopped_s.sum()
    assert heeding.touched_at_rest.sum() < heedless.touched_at_rest.sum()
    assert heeding.seconds.mean() < 1.3 * heedless.seconds.mean()


def test_a_decision_heeds_the_layer_it_is_monitored_by() -> None:
    """Somebody comes who would hold the robot, but not touch it: it makes room in time."""
    decider = MotionDecider(POLICY, CELL)
    question = MotionQuestion(
        q=decider.arm.home.copy(),
        qd=np.zeros(6),
        goal=np.array([0.0, 0.9, 0.3]),
        people=(person_from_cylinder(1.1, 0.66, -0.9, 0.0, 0.2),),
        safety=MEASURED,
    )
    began = [
        decider.decide(replace(question, safety=safety)).began
        for safety in (SafetySettings(), MEASURED)
    ]
    assert began[0] is None and began[1] is not None


def test_the_layer_is_told_anew_at_every_call() -> None:
    batch = standing((0.1, 1.8))
    ahead, acts = Lookahead(POLICY), np.zeros((1, 6), dtype=np.float32)
    for layer in (ssm_constraint_of(MEASURED, DT), NO_CONSTRAINT):
        ahead.layer = layer
        ahead.improve(batch, acts.copy())
        assert ahead._work is not None
        np.testing.assert_array_equal(ahead._work[1].layer, layer)
    assert ahead._work[1].kept[0] == 0.0
