"""Admitted paths, compared with finely sampled motions."""

import numpy as np
import pytest

from app.sim.cells.cell import load_cell
from app.sim.geometry.capsules import capsules_soa
from app.sim.robot.kernels import arm as arm_kernel
from app.sim.robot.kernels import override
from app.sim.robot.kernels.joints import JointPath
from app.sim.safety.kernels import ssm
from app.sim.safety.kernels.separation_check import (
    NOW,
    PeopleShapes,
    SeparationRule,
    new_ssm_workspace,
    place_node,
)
from app.sim.scene.scene import arm_of

ARM = arm_of(load_cell("pick-and-place"))
NO_CYLINDERS = np.zeros((0, 4))


def no_columns():
    return np.zeros((9, 0))


def shapes(people):
    return PeopleShapes(people, NO_CYLINDERS)


def spheres(rng, n=8):
    """Spheres and short capsules around the robot."""
    start = rng.uniform([-1.2, -0.2, 0.0], [1.2, 1.6, 1.2], (n, 3))
    ends = np.stack([start, start + rng.uniform(-0.2, 0.2, (n, 3))], axis=1)
    return capsules_soa(ends, rng.uniform(0.03, 0.15, n))


def motions(n, seed):
    """Random states in motion with paths of degree 3 in the limits, and people near them."""
    rng = np.random.default_rng(seed)
    while n:
        q = rng.uniform(ARM.limits.q_min, ARM.limits.q_max) * 0.8
        qd = rng.uniform(-1.0, 1.0, 6) * ARM.limits.qd_max
        first, last = rng.uniform(-1.0, 1.0, (2, 6)) * ARM.limits.qdd_max
        c, d = 0.5 * first, (last - first) / (6.0 * ARM.dt)
        if not override.keeps_limits(JointPath(q, qd, c, d), ARM.limits, ARM.dt):
            continue
        n -= 1
        yield q, qd, c, d, spheres(rng)


def clearances_at(q, people, space):
    place_node(ARM, shapes(people), q, NOW, 0.0, space)
    return space.clearance[NOW].copy()


def path_of(q, qd, c, d, rate, times):
    """Poses along a path at an override and the stop after it, with their times."""
    deceleration, q1, v1 = (1.0 - rate) / ARM.dt, np.empty(6), np.empty(6)
    override.motion_at(JointPath(q, qd, c, d), deceleration, ARM.dt, q1, v1)
    stop = override.stop_time(v1, ARM.limits.qdd_max)
    poses, none = [], np.zeros(6)
    for t in times(ARM.dt + stop):
        out, speed = np.empty(6), np.empty(6)
        if t <= ARM.dt:
            override.motion_at(JointPath(q, qd, c, d), deceleration, t, out, speed)
        else:
            override.motion_at(
                JointPath(q1, v1, none, none), 1.0 / stop, t - ARM.dt, out, speed
            )
        poses.append((t, out))
    return poses


def test_people_cannot_come_near_on_an_admitted_path():
    space, admitted = new_ssm_workspace(ARM, 8, 0), 0
    rule = SeparationRule(np.full(8, 0.5), 0.02, 0.05, np.zeros(8))
    for k, (q, qd, c, d, people) in enumerate(motions(400, 1)):
        rate = (1.0, 0.9)[k % 2]
        clearances_at(q, people, space)
        if not ssm.admissible(
            ARM, rule, 0.02, shapes(people), JointPath(q, qd, c, d), rate, space
        ):
            continue
        admitted += 1
        for t, pose in path_of(q, qd, c, d, rate, lambda end: np.linspace(0.0, end, 60)):
            assert clearances_at(pose, people, space).min() > 0.05 + 0.5 * (0.02 + t) - 1e-12
    assert 40 < admitted < 360


def test_people_of_known_velocity_are_not_met_on_an_admitted_path():
    """Cylinders with known velocities: anywhere on their path, and a little faster."""
    rng, space, admitted = (
        np.random.default_rng(9),
        new_ssm_workspace(ARM, 0, 2),
        0,
    )
    rule, no_capsules = (
        SeparationRule(np.full(2, 0.1), 0.02, 0.05, np.zeros(2)),
        no_columns(),
    )
    for k, (q, qd, c, d, _) in enumerate(motions(400, 10)):
        rate, cylinders = (1.0, 0.9)[k % 2], np.full((2, 4), 1.3)
        cylinders[:, :2], cylinders[:, 2] = rng.uniform(-1.5, 1.5, (2, 2)), 0.2
        space.velocity[:] = rng.uniform([-1.0, -1.0, -0.3], [1.0, 1.0, 0.3], (2, 3))
        going, growth = space.velocity[:, :2], np.maximum(0.0, space.velocity[:, 2])
        space.known_speed[:] = np.hypot(*going.T) + np.abs(space.velocity[:, 2])
        place_node(ARM, PeopleShapes(no_capsules, cylinders), q, NOW, 0.02, space)
        if not ssm.admissible(
            ARM,
            rule,
            0.02,
            PeopleShapes(no_capsules, cylinders),
            JointPath(q, qd, c, d),
            rate,
            space,
        ):
            continue
        admitted += 1
        for t, pose in path_of(q, qd, c, d, rate, lambda end: np.linspace(0.0, end, 30)):
            for since in np.linspace(0.0, 0.02 + t, 5):
                there = cylinders.copy()
                there[:, :2] += since * going
                there[:, 2] += since * growth
                other = new_ssm_workspace(ARM, 0, 2)
                place_node(
                    ARM,
                    PeopleShapes(no_capsules, there),
                    pose,
                    NOW,
                    0.0,
                    other,
                )
                assert other.clearance[NOW].min() > 0.05 + 0.1 * (0.02 + t) - 1e-9
    assert 40 < admitted < 360


def test_a_path_is_refused_only_where_people_come_within_the_resolution():
    space, refused = new_ssm_workspace(ARM, 8, 0), 0
    rule = SeparationRule(np.full(8, 0.5), 0.02, 0.05, np.zeros(8))
    for q, qd, c, d, people in motions(300, 2):
        clearances_at(q, people, space)
        if ssm.admissible(ARM, rule, 0.02, shapes(people), JointPath(q, qd, c, d), 1.0, space):
            continue
        poses = path_of(q, qd, c, d, 1.0, lambda end: np.linspace(0.0, end, 60))
        rest = poses[-1][1]
        if (rest < ARM.limits.q_min).any() or (rest > ARM.limits.q_max).any():
            continue
        refused += 1
        slack = [
            clearances_at(pose, people, space).min() - 0.05 - 0.5 * (0.02 + t)
            for t, pose in poses
        ]
        assert min(slack) < 0.02
    assert refused > 40


def test_an_admitted_stop_stays_admissible_as_people_run():
    """Step 2 of the proof: a period after any admitted path the stop obeys the rule."""
    rng, space = np.random.default_rng(3), new_ssm_workspace(ARM, 8, 0)
    rule, checked = SeparationRule(np.full(8, 0.5), 0.02, 0.05, np.zeros(8)), 0
    for q, qd, c, d, people in motions(400, 4):
        rate = ssm.decide(ARM, rule, 0.0, shapes(people), JointPath(q, qd, c, d), space)
        if rate == 0.0:
            continue
        q1, v1 = space.end.q.copy(), space.end.qd.copy()
        step = rng.normal(size=(3, 8))
        people[:3] += 0.5 * ARM.dt * step / np.linalg.norm(step, axis=0)
        stop, checked = override.stop_time(v1, ARM.limits.qdd_max), checked + 1
        assert (q1 + 0.5 * stop * v1 <= ARM.limits.q_max + 1e-9).all()
        assert (q1 + 0.5 * stop * v1 >= ARM.limits.q_min - 1e-9).all()
        for t in np.linspace(0.0, stop, 30):
            pose, speed, none = np.empty(6), np.empty(6), np.zeros(6)
            override.motion_at(
                JointPath(q1, v1, none, none), 1.0 / max(stop, 1e-9), t, pose, speed
            )
            assert clearances_at(pose, people, space).min() >= 0.05 + 0.5 * (0.02 + t) - 1e-12
    assert checked > 40


def test_a_part_observed_faster_than_assumed_counts_at_its_speed():
    """Decisions by observed speeds are those of rules that assume these speeds."""
    rng, space = np.random.default_rng(11), new_ssm_workspace(ARM, 8, 0)
    other, changed = new_ssm_workspace(ARM, 8, 0), 0
    slow = SeparationRule(np.full(8, 0.4), 0.05, 0.02, np.zeros(8))
    for q, qd, c, d, people in motions(300, 12):
        observed, path = rng.uniform(0.0, 2.0, 8), JointPath(q, qd, c, d)
        space.observed_speed[:] = 0.0
        unobserved = ssm.decide(ARM, slow, 0.0, shapes(people), path, space)
        space.observed_speed[:] = observed
        found = ssm.decide(ARM, slow, 0.0, shapes(people), path, space)
        fast = slow._replace(speed=np.maximum(0.4, observed))
        assert found == ssm.decide(ARM, fast, 0.0, shapes(people), path, other)
        np.testing.assert_array_equal(space.cause, other.cause)
        assert found <= unobserved
        changed += found < unobserved
    assert changed > 20


def test_a_path_s_bounds_hold_for_points_of_every_link():
    space = new_ssm_workspace(ARM, 8, 0)
    for q, qd, c, d, people in motions(100, 5):
        first, second = arm_kernel.path_bounds(ARM, JointPath(q, qd, c, d), ARM.dt)
        ends, x, h = [], np.linspace(0.0, ARM.dt, 21), ARM.dt / 20
        for s in x:
            clearances_at(q + s * (qd + s * (c + s * d)), people, space)
            ends.append(space.capsules[NOW, :3].copy())
        speed = np.linalg.norm(np.diff(ends, axis=0), axis=1) / h
        bend = np.linalg.norm(np.diff(ends, n=2, axis=0), axis=1) / h**2
        assert speed.max() <= first * (1.0 + 1e-9)
        assert bend.max() <= second * (1.0 + 1e-6)


def test_the_executed_motion_keeps_speed_acceleration_and_continuity():
    space = new_ssm_workspace(ARM, 8, 0)
    rule, seen = SeparationRule(np.full(8, 0.4), 0.0, 0.02, np.zeros(8)), set()
    for q, qd, c, d, people in motions(400, 6):
        rate = ssm.decide(ARM, rule, 0.0, shapes(people), JointPath(q, qd, c, d), space)
        seen.add("stop" if rate == 0.0 else "full" if rate == 1.0 else "scaled")
        speeds, speed, pose = [], np.empty(6), np.empty(6)
        for t in np.linspace(0.0, ARM.dt, 21):
            override.motion_at(
                JointPath(q, qd, space.c, space.d), space.deceleration[0], t, pose, speed
            )
            speeds.append(speed.copy())
        assert speeds[0] == pytest.approx(qd, abs=1e-15)
        assert (np.abs(speeds) <= ARM.limits.qd_max + 1e-9).all()
        assert (
            np.abs(np.diff(speeds, axis=0)) <= ARM.limits.qdd_max * ARM.dt / 20 + 1e-9
        ).all()
        assert pose == pytest.approx(space.end.q, abs=1e-15)
        assert speed == pytest.approx(space.end.qd, abs=1e-15)
    assert seen == {"stop", "full", "scaled"}


def test_joint_limits_hold_for_any_command_and_any_people():
    rng, space = np.random.default_rng(8), new_ssm_workspace(ARM, 8, 0)
    rule, closest, rates = (
        SeparationRule(np.full(8, 0.4), 0.0, 0.02, np.zeros(8)),
        np.inf,
        [],
    )
    q, qd = np.array(ARM.home), np.zeros(6)
    for k in range(3000):
        if k % 40 == 0:
            sign = rng.choice([-1.0, 1.0], 6)
        target = np.clip(
            sign * ARM.limits.qd_max,
            qd - ARM.limits.qdd_max * 0.05,
            qd + ARM.limits.qdd_max * 0.05,
        )
        mean = (target - qd) / ARM.dt
        slope = sign * rng.uniform(0.0, 1.0, 6) * (ARM.limits.qdd_max - np.abs(mean))
        c, d = 0.5 * (mean - slope), slope / (3.0 * ARM.dt)
        rates.append(
            ssm.decide(ARM, rule, 0.0, shapes(spheres(rng)), JointPath(q, qd, c, d), space)
        )
        q, qd = space.end.q.copy(), space.end.qd.copy()
        closest = min(closest, (ARM.limits.q_max - q).min(), (q - ARM.limits.q_min).min())
        assert (np.abs(qd) <= ARM.limits.qd_max + 1e-9).all()
    assert -1e-9 <= closest < 0.05
    assert 0.05 < np.mean(np.array(rates) == 0.0) < 0.95
