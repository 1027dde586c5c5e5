"""Speed and separation monitoring of one control period, compiled (METHOD 2.7).

**The rule.** The path of a period is the commanded piece, run at some override
(``robot/kernels/override.py``), and the straight stop from where it ends. A piece is executed
only if
at every moment ``t`` of that path, until the robot rests, every person as last seen, grown by

    reach(t) = v_h (lead + t) + D

is clear of the robot. Otherwise the stop from the present state is executed. ``lead`` is how
much older than the robot's state the people are, counting the controller's reaction: age of the
data, tracker's delay and reaction time. ``D = C + Z_d + Z_r`` plus the protective distance.
A cylinder whose velocity is known may be held to that instead: all of the way it goes at that
velocity since it was seen counts, as if it were there all the time, and ``v_h`` is only how
much faster it may be than was seen (``watch.py``).

``T_r`` of the standard is ``lead`` and the control period; ``T_s`` is the stop that the path
ends in; ``v_r T_r + B`` are not bounded by a speed but taken from the poses themselves.

**Why it holds.** Assume that no point of a person is faster than ``v_h`` and that data are no
older than stated. Let ``P`` be the people as seen at ``t_k``, when a path was admitted.

1. *While the robot moves nobody is nearer than D.* At ``t`` after ``t_k`` a person's points are
   within ``v_h (lead + t)`` of where they were seen, and the robot's pose is more than
   ``reach(t)`` from there. So a contact can only happen with the robot at rest.
2. *A stop that was admitted remains admissible.* One period later people are seen anew, as
   ``P'``, with a lead ``lead'``. Between the two sightings passed ``dt + lead - lead'``, which
   is not negative as long as news are never older than the news before. So ``P'`` is within
   ``v_h (dt + lead - lead')`` of ``P``, and for the rest of the path, ``t' = t - dt``::

       dist(P') >= dist(P) - v_h (dt + lead - lead')
                >  v_h (lead + t) + D - v_h (dt + lead - lead')  =  v_h (lead' + t') + D

   The rest of the path after the executed piece is the straight stop from the state then, and
   the rest of a stop is the stop from there: what is executed when nothing else is admitted was
   admitted before. By induction from rest, the rule always holds.
3. *Joint limits hold too.* A piece is admitted only if it keeps position, speed and
   acceleration limits and its stop rests inside the position limits; a straight stop is
   monotone in every joint and brakes each at no more than its limit.
4. *A reaction time is a delay.* If all motion is carried out R later than decided, the robot at
   ``t + R`` is where the decision had it at ``t``, while people have moved for R more: this is
   R more ``lead``.

5. *Where velocities are taken as known* the same holds of whoever stays as fast, in any
   direction, as seen at each of the times between two sightings and no more than the allowed
   change faster. Who changes by more, ``w`` in excess, is nearer than D by ``w (T_r + T_s)`` at
   most when the robot rests, because the stop is executed from the next sighting on: there is
   no contact in motion while that is less than D.

**Power and force limiting** is the same rule with a contact speed per part of a person instead
of 0: a part may be reached while no capsule's axis is faster than its limit anywhere, and a
surface comes nearer to what it meets no faster than its axis moves. All of the robot counts as
fast as its fastest axis; a person's own speed is not counted. Step 2 goes
through unchanged.

Between poses, see ``watch.py``: never late.

Source: ISO/TS 15066:2016, 5.5.4 and 5.5.5 (METHOD 2.7).
"""

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.robot.kernels.arm import Arm
from app.sim.robot.kernels.override import (
    TOLERANCE,
    clock,
    joint_keeps_limits,
    keeps_acceleration,
    lowest_override,
    motion_at,
    stop_time,
)
from app.sim.safety.kernels.separation_check import (
    END,
    NOW,
    REST,
    SLACK,
    WHEN,
    WHO,
    Safety,
    Watch,
    path_bounds,
    place_node,
    reached,
    segment_clear,
)

N_HALVINGS = 4
"""Steps of the search for the greatest admissible override."""


@kernel(error_model="numpy")
def _far(safety: Safety, way: float, since: float, later: float, watch: Watch) -> bool:
    """Whether nobody can meet a robot that goes no farther than ``way`` [m].

    Args:
        safety: What the rule assumes.
        way: How far any point of the robot goes [m].
        since: How long ago people were seen when it rests [s].
        later: How long that is from now [s].
        watch: Work space; node NOW is placed.
    """
    now = watch.gap[NOW]
    for j in range(now.shape[0]):
        reach = safety.speed[j] * since + watch.going_speed[j] * later + safety.margin
        if not now[j] - way > reach:
            return False
    return True


@kernel(error_model="numpy")
def admissible(
    arm: Arm, safety: Safety, lead: float, columns: Vec, cylinders: Vec, q: Vec, qd: Vec,
    c: Vec, d: Vec, override: float, watch: Watch,
) -> bool:  # fmt: skip
    """Whether a piece scaled to ``override``, and the stop after it, obey the rule.

    Args:
        arm: Robot in its cell.
        safety: What the rule assumes.
        lead: How much older than the robot's state the people are [s].
        columns: The people's capsules, shape (9, m).
        cylinders: Cylinders: x, y, radius, top [m], shape (n, 4).
        q: Joints [rad], shape (6,).
        qd: Speeds [rad/s], shape (6,).
        c: Second coefficients of the piece [rad/s^2], shape (6,).
        d: Third coefficients [rad/s^3], shape (6,).
        override: Above 0, up to 1.
        watch: Work space; node NOW is placed.
    """
    drop, q1, qd1 = (1.0 - override) / arm.dt, watch.q_end, watch.qd_end
    motion_at(q, qd, c, d, drop, arm.dt, q1, qd1)
    t_stop = stop_time(qd1, arm.limits.qdd_max)
    for j in range(6):
        rest = q1[j] + 0.5 * t_stop * qd1[j]
        if not arm.limits.q_min[j] - TOLERANCE <= rest <= arm.limits.q_max[j] + TOLERANCE:
            return False
        watch.q_node[j] = rest
    s_end = clock(drop, arm.dt)[0]
    first, second = path_bounds(arm, qd, c, d, s_end)
    stop_first, stop_second = path_bounds(arm, qd1, watch.none, watch.none, 0.0)
    way, since = first * s_end + 0.5 * t_stop * stop_first, lead + arm.dt + t_stop
    if _far(safety, way, since, since - lead, watch):
        return True
    place_node(arm, columns, cylinders, watch.q_node, REST, since, watch)
    if reached(safety, since, arm.dt + t_stop, REST, watch):
        return False
    place_node(arm, columns, cylinders, q1, END, lead + arm.dt, watch)
    if reached(safety, lead + arm.dt, arm.dt, END, watch):
        return False
    watch.x[NOW], watch.x[END] = 0.0, arm.dt
    if not segment_clear(
        arm, safety, lead, columns, cylinders, q, qd, c, d, drop, 0.0, first, second, NOW, END,
        watch,
    ):  # fmt: skip
        return False
    if t_stop <= 0.0:
        return True
    watch.x[END], watch.x[REST] = 0.0, t_stop
    return segment_clear(
        arm, safety, lead, columns, cylinders, q1, qd1, watch.none, watch.none, 1.0 / t_stop,
        arm.dt, stop_first, stop_second, END, REST, watch,
    )  # fmt: skip


@kernel(error_model="numpy")
def _execute(arm: Arm, q: Vec, qd: Vec, c: Vec, d: Vec, override: float, watch: Watch) -> None:
    """Write what is executed: the piece at an override, or the straight stop for 0."""
    stop = override <= 0.0
    drop = (1.0 - override) / arm.dt
    if stop:
        t_stop = stop_time(qd, arm.limits.qdd_max)
        drop = 1.0 / t_stop if t_stop > 0.0 else 0.0
    watch.drop[0] = drop
    s, rate = clock(drop, arm.dt)
    slowing = drop if rate > 0.0 else 0.0
    for j in range(6):
        watch.c[j], watch.d[j] = (0.0, 0.0) if stop else (c[j], d[j])
        along = qd[j] + s * (2.0 * watch.c[j] + 3.0 * s * watch.d[j])
        bend = 2.0 * watch.c[j] + 6.0 * s * watch.d[j]
        watch.qdd[j] = bend * rate * rate - slowing * along
    motion_at(q, qd, watch.c, watch.d, drop, arm.dt, watch.q, watch.qd)


@kernel(error_model="numpy")
def decide(
    arm: Arm, safety: Safety, age: float, columns: Vec, cylinders: Vec, q: Vec, qd: Vec,
    c: Vec, d: Vec, watch: Watch,
) -> float:  # fmt: skip
    """Decide how a period's piece is executed; return the override in [0, 1].

    1 executes it as commanded, a value between scales it along its path, 0 is the straight
    stop. Of the overrides tried (1, the least that acceleration limits admit, and N_HALVINGS
    between) the greatest admissible one is taken.

    Args:
        arm: Robot in its cell.
        safety: What the rule assumes.
        age: How old the people are beyond what ``safety.lead`` counts [s].
        columns: The people's capsules as last seen, shape (9, m).
        cylinders: Cylinders as last seen: x, y, radius, top [m], shape (n, 4).
        q: Joints [rad], shape (6,).
        qd: Speeds [rad/s], shape (6,).
        c: Second coefficients of the commanded piece [rad/s^2], shape (6,).
        d: Third coefficients [rad/s^3], shape (6,).
        watch: Work space; filled with what is executed and why.
    """
    lead = safety.lead + age
    watch.why[WHEN], watch.why[WHO], watch.why[SLACK] = 0.0, -1.0, 0.0
    place_node(arm, columns, cylinders, q, NOW, lead, watch)
    override = 0.0
    kept = not reached(safety, lead, 0.0, NOW, watch)
    for j in range(6):
        kept = kept and joint_keeps_limits(
            q[j], qd[j], c[j], d[j], arm.dt, arm.limits.q_min[j], arm.limits.q_max[j],
            arm.limits.qd_max[j],
            arm.limits.qdd_max[j],
        )  # fmt: skip
    if kept:
        override = _greatest_override(arm, safety, lead, columns, cylinders, q, qd, c, d, watch)
    _execute(arm, q, qd, c, d, override, watch)
    return override


@kernel(error_model="numpy")
def _greatest_override(
    arm: Arm, safety: Safety, lead: float, columns: Vec, cylinders: Vec, q: Vec, qd: Vec,
    c: Vec, d: Vec, watch: Watch,
) -> float:  # fmt: skip
    """Return the greatest admissible override of those tried; 0 where there is none."""
    if admissible(arm, safety, lead, columns, cylinders, q, qd, c, d, 1.0, watch):
        return 1.0
    low, high = lowest_override(qd, c, d, arm.limits.qdd_max, arm.dt), 1.0
    if low >= 1.0 or not admissible(
        arm, safety, lead, columns, cylinders, q, qd, c, d, low, watch
    ):
        return 0.0
    for _ in range(N_HALVINGS):
        middle = 0.5 * (low + high)
        if keeps_acceleration(qd, c, d, arm.limits.qdd_max, middle, arm.dt) and admissible(
            arm, safety, lead, columns, cylinders, q, qd, c, d, middle, watch
        ):
            low = middle
        else:
            high = middle
    return low
