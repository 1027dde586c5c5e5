"""Falsification of speed and separation monitoring by adversarial people, compiled.

A robot under a policy and the safety layer moves beside people that follow a script or run at
it (``adversarial_people.py``), never faster than the trial allows; there is no table and no
goal. The only measure is whether a contact finds a link in motion.

**Policies.** *Smooth*: speeds drift. *Constant*: full speed, until a limit. *Goals*: straight
to random configurations. *Bang-bang*: each joint at full speed in either direction for random
times.

**Contacts** are found by conservative advancement: with clearance ``g`` and a bound ``v`` on
the speed of approach, nothing touches before ``g/v``; steps end at a clearance of TOUCH. The
speed of the touching links then follows from exact kinematics.
"""

import math

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.core.kernels import rng as random
from app.sim.geometry.capsules import UX, UY, UZ, X, Y, Z, copy_rows, distances, least
from app.sim.people.kernels.motion import start_people
from app.sim.people.kernels.people import People
from app.sim.robot.kernels.actions import Coefficients, advance
from app.sim.robot.kernels.arm import CONTROLLED, Arm, path_bounds
from app.sim.robot.kernels.joints import JointPath, JointState
from app.sim.robot.kernels.override import motion_at, path_parameter
from app.sim.safety.kernels.adversarial_people import (
    Trial,
    TrialWorkspace,
    advance_cylinders,
    advance_workers,
    blend,
    people_speed,
    place_workers_at,
)
from app.sim.safety.kernels.separation_check import (
    NOW,
    PeopleShapes,
    SsmWorkspace,
    place_node,
)
from app.sim.safety.kernels.ssm import decide

SMOOTH, CONSTANT, GOALS, BANG_BANG = range(4)
"""Policies."""
TOUCH = 1e-7
"""Clearance that counts as contact [m]."""
MAX_ADVANCES = 500
"""Steps of the contact search per period at most; a slower approach counts as contact."""
START_CLEARANCE = 0.02
"""Least distance of robot and people at the start [m]."""
START_TRIES = 100
"""Greatest number of starts drawn; the last one counts with any clearance."""
MOVING = 1e-3
"""A touching link faster than this is a moving contact [m/s]."""

N_RESULT = 9
STEPS, CONTACT, SPEED, STOPPED, SLOWED, POLICY, MODE, WORST_PEOPLE, ALLOWED = range(N_RESULT)
"""Columns of a result: periods; whether the episode ended in contact; speed of the touching
link [m/s]; periods stopped, and slowed or stopped; policy; behaviour of the people; greatest
speed of any of their points [m/s]; speed at which the touched part may be touched [m/s]."""


@kernel(error_model="numpy", inline="always")
def _act(arm: Arm, policy: int, t: float, work: TrialWorkspace) -> None:
    """Write the action of a policy into ``work.act``.

    Args:
        policy: SMOOTH, CONSTANT, GOALS or BANG_BANG.
        t: Time since the start of the episode [s].
    """
    act, aim, rng = work.act, work.aim, work.rng
    if policy == GOALS:
        far = 0.0
        for j in range(CONTROLLED):
            far = max(far, abs(aim[j] - work.q[j]))
        if far < 0.02 or random.uniform(rng) < 0.01:
            for j in range(CONTROLLED):
                aim[j] = arm.limits.q_min[j] + random.uniform(rng) * (
                    arm.limits.q_max[j] - arm.limits.q_min[j]
                )
            return
        for j in range(CONTROLLED):
            act[j] = (aim[j] - work.q[j]) / max(far, 0.2)
        return
    for j in range(CONTROLLED):
        if policy == SMOOTH:
            act[j] = 0.9 * act[j] + 0.4 * random.normal(rng)
        elif t >= aim[j]:
            act[j] = 1.0 if random.uniform(rng) < 0.5 else -1.0
            aim[j] = t + (0.05 + 0.8 * random.uniform(rng) if policy == BANG_BANG else 1e9)


@kernel(error_model="numpy")
def link_speed(arm: Arm, space: SsmWorkspace, node: int, k: int, qd: Vec) -> float:
    """Return the greatest speed of any point on the axis of one of the robot's capsules [m/s].

    A capsule's surface comes nearer to anything no faster than its axis moves.

    Args:
        space: Work space with the links of the pose.
        node: Node where the pose's capsules are.
        k: The capsule.
        qd: Joint speeds [rad/s], shape (6,).
    """
    capsules, rot, pos = space.capsules[node], space.rot, space.pos
    fastest = 0.0
    for end in range(2):
        px = capsules[X, k] + end * capsules[UX, k]
        py = capsules[Y, k] + end * capsules[UY, k]
        pz = capsules[Z, k] + end * capsules[UZ, k]
        vx, vy, vz = 0.0, 0.0, 0.0
        for j in range(arm.link[k]):
            # Joints 0 and 4 turn about their link's z axis, the others about y.
            axis = 2 if j == 0 or j == 4 else 1
            ax, ay, az = rot[j + 1, 0, axis], rot[j + 1, 1, axis], rot[j + 1, 2, axis]
            rx, ry, rz = px - pos[j + 1, 0], py - pos[j + 1, 1], pz - pos[j + 1, 2]
            vx += qd[j] * (ay * rz - az * ry)
            vy += qd[j] * (az * rx - ax * rz)
            vz += qd[j] * (ax * ry - ay * rx)
        fastest = max(fastest, math.sqrt(vx * vx + vy * vy + vz * vz))
    return float(fastest)


@kernel(error_model="numpy", inline="always")
def touching_speed(arm: Arm, j: int, work: TrialWorkspace) -> float:
    """Return the speed of the fastest link that touches part ``j`` of the people [m/s].

    With a cylinder the fastest of all links counts.
    """
    touch, m = work.touch, work.capsules.shape[1]
    fastest = 0.0
    if j < m:
        distances(work.capsules, j, touch.capsules[NOW], work.toward)
    for k in range(arm.link.shape[0]):
        if j >= m or work.toward[k] <= 10.0 * TOUCH:
            fastest = max(fastest, link_speed(arm, touch, NOW, k, touch.qd_node))
    return fastest


@kernel(error_model="numpy", inline="always")
def first_contact(arm: Arm, work: TrialWorkspace) -> tuple[float, int]:
    """Return the time of a period's contact [s], -1 if none, and the part of the people."""
    ssm, touch, dt = work.ssm, work.touch, arm.dt
    path = JointPath(work.q, work.qd, ssm.c, ssm.d)
    s_end, _ = path_parameter(ssm.deceleration[0], dt)
    speed, _ = path_bounds(arm, path, s_end)
    approach = speed + people_speed(work, dt)
    t, j = 0.0, 0
    for _ in range(MAX_ADVANCES):
        part = t / dt
        blend(work.capsules0, work.capsules1, part, work.capsules)
        for k in range(work.cylinders.shape[0]):
            for i in range(3):
                old = work.cylinders0[k, i]
                work.cylinders[k, i] = old + part * (work.cylinders1[k, i] - old)
        motion_at(path, ssm.deceleration[0], t, touch.q_node, touch.qd_node)
        people = PeopleShapes(work.capsules, work.cylinders)
        place_node(arm, people, touch.q_node, NOW, 0.0, touch)
        clearance, j = least(touch.clearance[NOW])
        if clearance <= TOUCH:
            return t, j
        if t >= dt:
            return -1.0, 0
        t = min(dt, t + clearance / approach) if approach > 0.0 else dt
    return t, j


@kernel(error_model="numpy", inline="always")
def _draw_place(arm: Arm, people: People, work: TrialWorkspace) -> float:
    """Draw a configuration at rest and places of people; return the clearance [m]."""
    rng = work.rng
    for j in range(6):
        work.q[j], work.qd[j], work.qdd[j] = arm.home[j], 0.0, 0.0
    for j in range(CONTROLLED):
        work.q[j] = arm.limits.q_min[j] + random.uniform(rng) * (
            arm.limits.q_max[j] - arm.limits.q_min[j]
        )
    start_people(people, work.state, 0, rng, work.geometry)
    for w in range(work.time.shape[0]):
        work.time[w] = 0.0
        work.offset[w, 0], work.offset[w, 1], work.offset[w, 2] = 0.0, 0.0, 0.0
    place_workers_at(people, work, 0.0)
    copy_rows(work.capsules1, work.capsules0)
    for k in range(work.cylinders0.shape[0]):
        for i in range(3):
            work.cylinders0[k, i] = work.state.cylinders[0, k, i]
        work.cylinders0[k, 3] = people.top_z
    copy_rows(work.cylinders0, work.cylinders1)
    copy_rows(work.cylinders0, work.cylinders)
    shapes = PeopleShapes(work.capsules0, work.cylinders0)
    place_node(arm, shapes, work.q, NOW, 0.0, work.ssm)
    return least(work.ssm.clearance[NOW])[0]


@kernel(error_model="numpy", inline="always")
def _start(arm: Arm, people: People, policy: int, seconds: float, work: TrialWorkspace) -> None:
    """Draw the start of an episode and the time at which people begin to run."""
    for _ in range(START_TRIES):
        if _draw_place(arm, people, work) >= START_CLEARANCE:
            break
    for i in range(work.seen_capsules.shape[0]):
        copy_rows(work.capsules0, work.seen_capsules[i])
        copy_rows(work.cylinders0, work.seen_cylinders[i])
    for j in range(6):
        work.aim[j] = work.q[j] if policy == GOALS else 0.0
    for j in range(CONTROLLED):
        work.act[j] = 0.0
    work.plan[0], work.plan[1], work.plan[3] = 0.0, 0.0, 1.0
    work.plan[2] = 0.7 * seconds * random.uniform(work.rng)


@kernel(error_model="numpy", inline="always")
def _step(
    arm: Arm,
    people: People,
    trial: Trial,
    policy: int,
    mode: int,
    step: int,
    work: TrialWorkspace,
    out: Vec,
) -> bool:
    """Run one period; return whether the episode ends in contact."""
    t, slot = step * arm.dt, step % (trial.n_late + 1)
    copy_rows(work.capsules0, work.seen_capsules[slot])
    copy_rows(work.cylinders0, work.seen_cylinders[slot])
    oldest = (step + 1) % (trial.n_late + 1)
    _act(arm, policy, t, work)
    end, ssm = work.end, work.ssm
    start, segment = JointState(work.q, work.qd, work.qdd), Coefficients(work.c, work.d)
    advance(trial.action, arm.limits, arm.dt, start, work.act, segment, end)
    seen = PeopleShapes(work.seen_capsules[oldest], work.seen_cylinders[oldest])
    path = JointPath(work.q, work.qd, work.c, work.d)
    override = decide(arm, trial.rule, 0.0, seen, path, ssm)
    if not trial.monitored:
        override, ssm.deceleration[0] = 1.0, 0.0
        for j in range(6):
            ssm.c[j], ssm.d[j] = work.c[j], work.d[j]
            ssm.end.q[j], ssm.end.qd[j], ssm.end.qdd[j] = end.q[j], end.qd[j], end.qdd[j]
    out[STEPS] = step + 1.0
    out[STOPPED] += 1.0 if override <= 0.0 else 0.0
    out[SLOWED] += 1.0 if override < 1.0 else 0.0
    place_node(arm, PeopleShapes(work.capsules0, work.cylinders0), work.q, NOW, 0.0, work.touch)
    advance_workers(people, trial, mode, t, arm.dt, work)
    advance_cylinders(people, trial, mode, t, arm.dt, work)
    out[WORST_PEOPLE] = max(out[WORST_PEOPLE], people_speed(work, arm.dt))
    when, part = first_contact(arm, work)
    if when >= 0.0:
        out[CONTACT], out[ALLOWED] = 1.0, trial.rule.contact_speed[part]
        out[SPEED] = touching_speed(arm, part, work)
        return True
    copy_rows(work.capsules1, work.capsules0)
    copy_rows(work.cylinders1, work.cylinders0)
    for j in range(6):
        work.q[j], work.qd[j], work.qdd[j] = ssm.end.q[j], ssm.end.qd[j], ssm.end.qdd[j]
    return False


@kernel(nogil=True, error_model="numpy")
def run_episodes(
    arm: Arm,
    people: People,
    trial: Trial,
    seed: int,
    first: int,
    work: TrialWorkspace,
    out: Vec,
) -> None:
    """Run episodes ``first`` and following; each is determined by (seed, number).

    Args:
        trial: Settings of the trial.
        seed: Seed of the trial.
        first: Number of the first episode.
        out: Filled with results, shape (n, N_RESULT).
    """
    for e in range(out.shape[0]):
        row, number = out[e], first + e
        random.start_stream(seed, number, 0, work.rng)
        policy, mode = number % 4, (number // 4) % 4
        for k in range(N_RESULT):
            row[k] = 0.0
        row[POLICY], row[MODE] = policy, mode
        _start(arm, people, policy, trial.n_steps * arm.dt, work)
        for step in range(trial.n_steps):
            if _step(arm, people, trial, policy, mode, step, work, row):
                break
