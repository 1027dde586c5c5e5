"""Rollouts under a safety layer with measured velocities: the layer stops the robot less."""

from dataclasses import replace

import numpy as np
import pytest

from app.policies.checkpoints import pretrained
from app.policies.evaluation.reach.ssm_crossings import Comparison
from app.policies.inference.controllers import RolloutController, controller_of
from app.policies.inference.motion_decision import MotionDecider
from app.policies.inference.reach_policy import ReachPolicy
from app.policies.inference.rollout import (
    LONGEST_HORIZON,
    NO_CONSTRAINT,
    SPARE_DISTANCE,
    RolloutImprovement,
    SsmConstraint,
    ssm_constraint_of,
)
from app.sim.cells.cell import load_cell
from app.sim.people.kernels.pedestrian import GAIT, STILL, VX, VY, X, Y
from app.sim.perception.observed_people import person_from_cylinder
from app.sim.reach.batch import ReachBatch, ReachSettings
from app.sim.reach.crossings import crossings
from app.sim.reach.motion_types import MotionQuery
from app.sim.reach.rollout.kernels import rollout
from app.sim.reach.rollout.kernels.prediction import N_LONG_MOMENTS, N_MOMENTS, predict_people
from app.sim.robot.kernels.arm import new_robot_pose, place_robot
from app.sim.safety.layer import SafetySettings, safety_settings
from tests.policies.inference.test_rollout import workspace

CELL = load_cell("shared-workspace")
ACTOR = ReachPolicy(pretrained.load("reach"))
MEASURED = replace(safety_settings(CELL), use_measured_velocity=True)
DT = CELL.robot.dt


def standing(*places: tuple[float, float]) -> ReachBatch:
    """Return robots at home, each beside a person at rest."""
    settings = ReachSettings(people=("walker",), observation="forecast")
    batch = ReachBatch(CELL, len(places), 1, settings)
    batch.reset()
    rows = batch.state.people.walkers.rows
    rows[:, 0, [X, Y]], rows[:, 0, GAIT], rows[:, 0, [VX, VY]] = places, STILL, 0.0
    return batch


def constrained(batch: ReachBatch, constraint: SsmConstraint) -> list[tuple[float, np.ndarray]]:
    """Return for each environment the required distance [m] and the goal configuration."""
    work, found = workspace(batch), []
    work.ssm[:] = constraint
    for e in range(batch.n_envs):
        predict_people(
            batch.world, batch.state, e, N_LONG_MOMENTS, work.observation, work.people
        )
        rollout.apply_ssm_constraint(batch.world, batch.state, e, work)
        found.append((float(work.ssm_distance[0]), work.q_goal.copy()))
    return found


@pytest.mark.parametrize("settings", [None, SafetySettings()])
def test_no_constraint_without_measured_velocities(settings: SafetySettings | None) -> None:
    assert ssm_constraint_of(settings, DT) == NO_CONSTRAINT


def test_constraint_follows_from_the_assumptions_of_the_layer() -> None:
    settings = replace(MEASURED, speed_change=0.5, intrusion_distance=0.05)
    ahead = 0.1 + 0.02 + 0.03
    layer = ssm_constraint_of(settings, 0.02, age=0.03)
    assert layer.horizon == pytest.approx(ahead)
    assert layer.distance == pytest.approx(0.35 + 0.5 * ahead + SPARE_DISTANCE)
    assert ssm_constraint_of(settings, 0.02, age=60.0).horizon == LONGEST_HORIZON


def test_no_constraint_for_a_person_who_is_too_near_already() -> None:
    layer = ssm_constraint_of(MEASURED, DT)
    near, far = constrained(standing((0.1, 0.95), (0.1, 1.8)), layer)
    assert near[0] == 0.0 and far[0] == layer.distance


def test_a_configuration_is_found_at_every_target() -> None:
    targets = ACTOR.targets
    assert targets is not None and len(targets) == 54
    batch = standing(*[(-2.0, 2.0)] * 54)
    batch.set_goals(np.arange(54), targets)
    pose = new_robot_pose(batch.arm)
    for goal, (_, q_goal) in zip(
        targets, constrained(batch, ssm_constraint_of(MEASURED, DT)), strict=True
    ):
        place_robot(batch.arm, q_goal, pose)
        assert np.linalg.norm(pose.tcp - goal) < 0.1
        assert (batch.arm.limits.q_min <= q_goal).all() and (
            q_goal <= batch.arm.limits.q_max
        ).all()


def test_longer_predictions_agree_with_shorter_ones() -> None:
    settings = ReachSettings(people=("walker",), observation="forecast")
    found = []
    for moments in (N_MOMENTS, N_LONG_MOMENTS):
        batch = ReachBatch(CELL, 40, 7, settings)
        batch.reset()
        work = workspace(batch)
        for e in range(40):
            predict_people(batch.world, batch.state, e, moments, work.observation, work.people)
            found.append(work.people.places[:N_MOMENTS, 0].copy())
    np.testing.assert_array_equal(found[:40], found[40:])


def test_constraint_reduces_stops_and_contacts_beside_crossing_people() -> None:
    """Six crossings that are not evaluated elsewhere."""
    settings = ReachSettings(action=ACTOR.action, observation=ACTOR.view)
    comparison = Comparison(CELL, crossings(CELL, 6, seed=77), settings, MEASURED, seed=11)
    direct = controller_of(ACTOR, "direct")
    agnostic, aware = (
        comparison.policy(RolloutController(direct, ACTOR, layer)).episodes
        for layer in (NO_CONSTRAINT, ssm_constraint_of(MEASURED, DT))
    )
    assert aware.arrived.all() and not aware.touched_moving.any()
    assert aware.stopped_s.sum() < 0.5 * agnostic.stopped_s.sum()
    assert aware.touched_at_rest.sum() < agnostic.touched_at_rest.sum()
    assert aware.seconds.mean() < 1.3 * agnostic.seconds.mean()


def test_decisions_consider_the_layer_that_monitors_them() -> None:
    """A person approaches who would stop the robot without touching it."""
    decider = MotionDecider(ACTOR, CELL)
    query = MotionQuery(
        q=decider.arm.home.copy(),
        qd=np.zeros(6),
        goal=np.array([0.0, 0.9, 0.3]),
        people=(person_from_cylinder(1.1, 0.66, -0.9, 0.0, 0.2),),
        safety=MEASURED,
    )
    began = [
        decider.decide(replace(query, safety=safety)).candidate
        for safety in (SafetySettings(), MEASURED)
    ]
    assert began[0] is None and began[1] is not None


def test_constraint_is_updated_at_every_call() -> None:
    batch = standing((0.1, 1.8))
    ahead, acts = RolloutImprovement(ACTOR), np.zeros((1, 6), dtype=np.float32)
    for layer in (ssm_constraint_of(MEASURED, DT), NO_CONSTRAINT):
        ahead.constraint = layer
        ahead.improve(batch, acts.copy())
        assert ahead._work is not None
        np.testing.assert_array_equal(ahead._work.ssm, layer)
    assert ahead._work.ssm_distance[0] == 0.0
