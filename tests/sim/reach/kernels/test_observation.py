"""Observations of the reach scenario: layout, the person as a cylinder, looking ahead."""

import numpy as np
import pytest

from app.sim.cells.cell import load_cell
from app.sim.collision import contact
from app.sim.geometry.capsules import RADIUS, ends_of
from app.sim.human.kernels import kinematics as body
from app.sim.people.kernels.pedestrian import VX, VY, R, X, Y
from app.sim.reach.batch import ReachBatch, ReachSettings
from app.sim.reach.kernels.observation import (
    CENTER_Y,
    LAYOUT,
    N_FEATURES,
    N_STATE,
    NO_PERSON,
    SCALE,
    enclosing_radius,
)
from app.sim.robot.ur10 import Robot
from app.sim.scenario.kernels.person_observation import HORIZONS
from app.sim.scene.scene import NO_CYLINDERS


def batch_of(*people: str, observation: str = "features", n_envs: int = 6) -> ReachBatch:
    """A batch some periods into its episodes."""
    settings = ReachSettings(people=people, observation=observation)
    batch = ReachBatch(load_cell("shared-workspace"), n_envs, 31, settings)
    batch.reset()
    rng = np.random.default_rng(32)
    for _ in range(20):
        batch.step(rng.uniform(-1, 1, (n_envs, 6)).astype(np.float32))
    return batch


def observed(batch: ReachBatch) -> np.ndarray:
    return batch.step(np.zeros((batch.n_envs, 6), dtype=np.float32)).obs


def test_layout_covers_the_observation_without_gaps() -> None:
    ends = [(part.start, part.stop) for part in LAYOUT.values()]
    assert ends[0][0] == 0 and ends[-1][1] == N_FEATURES
    assert all(a[1] == b[0] for a, b in zip(ends, ends[1:], strict=False))


def test_plain_state_is_that_of_4_30() -> None:
    batch = batch_of("walker", observation="state")
    obs, state = observed(batch), batch.state
    walker = state.people.walkers.rows[:, 0, [X, Y, VX, VY, R]]
    expected = np.concatenate([state.q, state.qd, walker, state.goal], axis=1)
    assert obs.shape == (6, N_STATE)
    np.testing.assert_array_equal(obs, expected.astype(np.float32))


def test_features_hold_what_the_data_sheet_says() -> None:
    batch = batch_of("walker")
    obs, state = observed(batch), batch.state
    x = state.people.walkers.rows[:, 0, [X, Y]]
    robot = Robot(batch.cell.robot.tool_length)
    tcp = np.array([robot.tcp_pose(q)[:3, 3] for q in state.q])
    qd = state.qd
    later = np.array([robot.tcp_pose(q)[:3, 3] for q in state.q + 1e-6 * qd])
    expected = {
        "q": state.q / np.pi,
        "qd": qd / 1.0,
        "goal": state.goal,
        "sin_q": np.sin(state.q),
        "cos_q": np.cos(state.q),
        "tcp": tcp,
        "goal_minus_tcp": 2.0 * (state.goal - tcp),
        "tcp_velocity": (later - tcp) / 1e-6,
        "human_minus_tcp": x - tcp[:, :2],
        "human_minus_elbow": x - np.array([robot.link_poses(q)[3, :2, 3] for q in state.q]),
        "human_minus_goal": x - state.goal[:, :2],
        "clearance": np.minimum(3.0, state.clear[:, :1] / SCALE),
        "distance": 2.0 * state.distance[:, None],
        "time_left": state.time_left[:, None] / 2.5,
    }
    for name, values in expected.items():
        np.testing.assert_allclose(obs[:, LAYOUT[name]], values, atol=1e-5, err_msg=name)
    np.testing.assert_allclose(obs[:, LAYOUT["human"].start + 1], x[:, 1] - CENTER_Y, atol=1e-6)


@pytest.mark.parametrize("people", [("walker",), ("constant", "fixed-speed", "walker")])
def test_look_ahead_is_the_clearance_with_walkers_moved_on(people: tuple[str, ...]) -> None:
    batch = batch_of(*people)
    obs, state = observed(batch), batch.state
    for e in range(batch.n_envs):
        rows = state.people.walkers.rows[e]
        for i, ahead in enumerate(HORIZONS):
            moved = rows[:, [X, Y, R]].copy()
            moved[:, :2] += ahead * rows[:, [VX, VY]]
            found = contact.clearance(
                batch.arm, batch.world.people, state.q[e], np.zeros((0, 18)), moved
            )
            expected = min(3.0, found.people_m / SCALE)
            assert obs[e, LAYOUT["look_ahead"]][i] == pytest.approx(expected, abs=1e-6)


def test_look_ahead_moves_a_workers_joints_on() -> None:
    batch = batch_of("worker")
    obs, state = observed(batch), batch.state
    for e in range(batch.n_envs):
        moved = state.people.q[e] + HORIZONS[0] * state.people.qd[e]
        found = contact.clearance(
            batch.arm, batch.world.people, state.q[e], moved, NO_CYLINDERS
        )
        got = obs[e, LAYOUT["look_ahead"]][0]
        assert got == pytest.approx(min(3.0, found.people_m / SCALE), abs=0.05)


def test_worker_is_seen_as_the_cylinder_that_contains_the_capsules() -> None:
    batch = batch_of("worker", observation="state")
    obs, people = observed(batch), batch.state.people
    for e in range(batch.n_envs):
        x, y, _, _, r = obs[e, 12:17]
        assert (x, y) == pytest.approx(people.q[e, 0, :2], abs=1e-6)
        ends = ends_of(people.capsules[e], body.N_CAPSULES)[..., :2] - people.q[e, 0, :2]
        radii = people.capsules[e, RADIUS, : body.N_CAPSULES]
        reach = np.linalg.norm(ends, axis=2).max(axis=1) + radii
        assert r == pytest.approx(reach.max(), abs=1e-6)


def test_enclosing_radius_of_one_capsule_is_its_farther_end_and_radius() -> None:
    capsules = np.zeros((9, 1))
    capsules[:, 0] = [1.0, 0.0, 0.0, 2.0, 0.0, 0.0, 4.0, 0.25, 0.25]
    assert enclosing_radius(capsules, 0, 1, 0.0, 0.0) == 3.25
    assert enclosing_radius(capsules, 0, 1, 3.0, 0.0) == 2.25


def test_empty_cell_is_observed_as_a_person_far_away() -> None:
    obs = observed(batch_of(observation="state"))
    np.testing.assert_allclose(obs[:, 12:17], np.tile(NO_PERSON[:5], (6, 1)), rtol=1e-6)
    far = observed(batch_of())
    assert (far[:, LAYOUT["clearance"]] == 3.0).all()
    assert (far[:, LAYOUT["look_ahead"]] == 3.0).all()


def test_nearest_of_several_people_is_seen() -> None:
    batch = batch_of("walker", "constant", "fixed-speed", observation="state", n_envs=20)
    obs, state = observed(batch), batch.state
    for e in range(batch.n_envs):
        gaps = [
            contact.clearance(
                batch.arm, batch.world.people, state.q[e], np.zeros((0, 18)), row[None]
            ).people_m
            for row in state.people.cylinders[e]
        ]
        seen = state.people.cylinders[e, int(np.argmin(gaps)), :2]
        np.testing.assert_allclose(obs[e, 12:14], seen, rtol=1e-6)
