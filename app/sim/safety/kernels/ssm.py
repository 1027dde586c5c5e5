"""Speed and separation monitoring of one control period, compiled (docs/method.md 2.7).

**The rule.** The path of a period is the commanded trajectory, executed at some override
(``override.py``), and the straight stop from its end. A trajectory is executed only if, at
every time ``t`` of that path until the robot rests, every person as last observed, grown by

    reach(t) = v_h (T + t) + D

is clear of the robot. Otherwise the stop from the current state is executed. ``v_h`` is an
assumption; a part of a person that is observed faster counts at its observed speed. The latency
``T`` is the age of the people relative to the robot's state, including the controller's
reaction: age of the data, tracker delay and reaction time. ``D = C + Z_d + Z_r`` plus the
protective distance. A cylinder with a known velocity may be extrapolated instead: it counts
along its whole path at that velocity since its observation, as if present everywhere on it, and
``v_h`` is only the assumed excess over the observed speed (``separation_check.py``).

``T_r`` of the standard is the latency and the control period; ``T_s`` is the stop at the end of
the path; ``v_r T_r + B`` are not bounded by a speed but computed from the poses themselves.

**Why it holds.** Assume that no point of a person is faster than ``v_h`` and that data are no
older than stated. Let ``P`` be the people as observed at ``t_k``, when a path was admitted.

1. *While the robot moves nobody is nearer than D.* At ``t`` after ``t_k`` a person's points are
   within ``v_h (T + t)`` of their observed positions, and the robot's pose is more than
   ``reach(t)`` from there. So a contact can only happen with the robot at rest.
2. *A stop that was admitted remains admissible.* One period later people are observed again, as
   ``P'``, with latency ``T'``. Between both observations ``dt + T - T'`` passed, which is not
   negative as long as data are never older than the data before. So ``P'`` is within
   ``v_h (dt + T - T')`` of ``P``, and for the rest of the path, ``t' = t - dt``::

       dist(P') >= dist(P) - v_h (dt + T - T')
                >  v_h (T + t) + D - v_h (dt + T - T')  =  v_h (T' + t') + D

   The rest of the path after the executed period is the straight stop from the state then, and
   the rest of a stop is the stop from there: the motion executed when nothing else is admitted
   was admitted before. By induction from rest, the rule always holds.
3. *Joint limits hold too.* A trajectory is admitted only if it keeps position, speed and
   acceleration limits and its stop rests inside the position limits; a straight stop is
   monotone in every joint and brakes each at no more than its limit.
4. *A reaction time is a delay.* If all motion is executed R later than decided, the robot at
   ``t + R`` is where the decision had it at ``t``, while people have moved for R more: this is
   R more latency.
5. *With known velocities* the same holds for people whose speed in any direction exceeds the
   observed one by no more than the allowed change until ``T_r`` after the observation. A
   person faster by a further ``w`` is nearer than D by at most ``w (T_r + T_s)`` when the robot
   rests, because the stop is executed from the next observation on: there is no contact in
   motion while that is less than D.

**Power and force limiting** is the same rule with a contact speed per part of a person instead
of 0: a part may be reached while no capsule's axis is faster than its limit anywhere; a surface
approaches an obstacle no faster than its axis moves. The whole robot counts as fast as its
fastest axis; a person's own speed is not counted. Step 2 holds unchanged.

**People faster than assumed.** Observed speeds only make ``reach(t)`` longer, so all of this
holds for people who keep to ``v_h``. Beside others the robot stops earlier and starts later,
but nothing is guaranteed: a person may become even faster after the observation.

Between poses the check is conservative, see ``separation_check.py``.

Source: ISO/TS 15066:2016, 5.5.4 and 5.5.5 (docs/method.md 2.7).
"""

from app.sim.core.jit import kernel
from app.sim.robot.kernels.arm import Arm, path_bounds
from app.sim.robot.kernels.joints import JointPath
from app.sim.robot.kernels.override import (
    TOLERANCE,
    keeps_acceleration,
    keeps_limits,
    lowest_override,
    motion_at,
    path_parameter,
    stop_time,
)
from app.sim.safety.kernels.separation_check import (
    CAUSE_PART,
    CAUSE_SHORTFALL,
    END,
    NOW,
    REST,
    PathSegment,
    PeopleShapes,
    SeparationRule,
    SsmWorkspace,
    person_reach,
    place_node,
    segment_clear,
    violates_separation,
)

N_HALVINGS = 4
"""Steps of the search for the greatest admissible override."""


@kernel(error_model="numpy")
def _trivially_separated(
    rule: SeparationRule, distance: float, age: float, later: float, space: SsmWorkspace
) -> bool:
    """Return whether no person can reach a robot that moves at most ``distance``.

    Args:
        rule: Assumptions.
        distance: Bound on the displacement of any point of the robot [m].
        age: Time since people were observed, when it rests [s].
        later: Time until it rests [s].
        space: Work space; node NOW is placed.
    """
    now = space.clearance[NOW]
    for j in range(now.shape[0]):
        reach = person_reach(rule, j, age, space) + space.known_speed[j] * later
        if not now[j] - distance > reach:
            return False
    return True


@kernel(error_model="numpy")
def admissible(
    arm: Arm,
    rule: SeparationRule,
    latency: float,
    people: PeopleShapes,
    path: JointPath,
    override: float,
    space: SsmWorkspace,
) -> bool:
    """Return whether a path scaled to ``override``, and the stop after it, obey the rule.

    Args:
        rule: Assumptions.
        latency: Age of people relative to the robot's state [s].
        people: People as observed.
        path: Commanded path of the period.
        override: Above 0, up to 1.
        space: Work space; node NOW is placed.
    """
    deceleration, q1, qd1 = (1.0 - override) / arm.dt, space.q_end, space.qd_end
    motion_at(path, deceleration, arm.dt, q1, qd1)
    t_stop = stop_time(qd1, arm.limits.qdd_max)
    for j in range(6):
        rest = q1[j] + 0.5 * t_stop * qd1[j]
        if not (arm.limits.q_min[j] - TOLERANCE <= rest <= arm.limits.q_max[j] + TOLERANCE):
            return False
        space.q_node[j] = rest
    stop = JointPath(q1, qd1, space.none, space.none)
    s_end = path_parameter(deceleration, arm.dt)[0]
    speed, curvature = path_bounds(arm, path, s_end)
    stop_speed, stop_curvature = path_bounds(arm, stop, 0.0)
    distance, age = speed * s_end + 0.5 * t_stop * stop_speed, latency + arm.dt + t_stop
    if _trivially_separated(rule, distance, age, age - latency, space):
        return True
    place_node(arm, people, space.q_node, REST, age, space)
    if violates_separation(rule, age, REST, space):
        return False
    place_node(arm, people, q1, END, latency + arm.dt, space)
    if violates_separation(rule, latency + arm.dt, END, space):
        return False
    space.x[NOW], space.x[END] = 0.0, arm.dt
    segment = PathSegment(path, deceleration, 0.0, speed, curvature, NOW, END)
    if not segment_clear(arm, rule, latency, people, segment, space):
        return False
    if t_stop <= 0.0:
        return True
    space.x[END], space.x[REST] = 0.0, t_stop
    segment = PathSegment(stop, 1.0 / t_stop, arm.dt, stop_speed, stop_curvature, END, REST)
    return segment_clear(arm, rule, latency, people, segment, space)


@kernel(error_model="numpy")
def _execute(arm: Arm, path: JointPath, override: float, space: SsmWorkspace) -> None:
    """Write the executed motion: the path at an override, or the straight stop for 0."""
    stop = override <= 0.0
    deceleration = (1.0 - override) / arm.dt
    if stop:
        t_stop = stop_time(path.qd, arm.limits.qdd_max)
        deceleration = 1.0 / t_stop if t_stop > 0.0 else 0.0
    space.deceleration[0] = deceleration
    s, path_speed = path_parameter(deceleration, arm.dt)
    slowing = deceleration if path_speed > 0.0 else 0.0
    for j in range(6):
        space.c[j], space.d[j] = (0.0, 0.0) if stop else (path.c[j], path.d[j])
        along = path.qd[j] + s * (2.0 * space.c[j] + 3.0 * s * space.d[j])
        bend = 2.0 * space.c[j] + 6.0 * s * space.d[j]
        space.end.qdd[j] = bend * path_speed * path_speed - slowing * along
    executed = JointPath(path.q, path.qd, space.c, space.d)
    motion_at(executed, deceleration, arm.dt, space.end.q, space.end.qd)


@kernel(error_model="numpy")
def decide(
    arm: Arm,
    rule: SeparationRule,
    age: float,
    people: PeopleShapes,
    path: JointPath,
    space: SsmWorkspace,
) -> float:
    """Decide how the commanded path of a period is executed; return the override in [0, 1].

    1 executes it as commanded, a value between scales it along its path, 0 is the straight
    stop. Of the overrides tried (1, the least that acceleration limits admit, and N_HALVINGS
    between) the greatest admissible one is taken.

    Args:
        rule: Assumptions.
        age: Age of the people beyond ``rule.latency`` [s].
        people: People as last observed.
        space: Work space; filled with the executed motion and the cause of the override.
    """
    latency = rule.latency + age
    space.cause[CAUSE_PART], space.cause[CAUSE_SHORTFALL] = -1.0, 0.0
    place_node(arm, people, path.q, NOW, latency, space)
    override = 0.0
    if not violates_separation(rule, latency, NOW, space) and keeps_limits(
        path, arm.limits, arm.dt
    ):
        override = _greatest_override(arm, rule, latency, people, path, space)
    _execute(arm, path, override, space)
    return override


@kernel(error_model="numpy")
def _greatest_override(
    arm: Arm,
    rule: SeparationRule,
    latency: float,
    people: PeopleShapes,
    path: JointPath,
    space: SsmWorkspace,
) -> float:
    """Return the greatest admissible override among the candidates; 0 without any."""
    if admissible(arm, rule, latency, people, path, 1.0, space):
        return 1.0
    qdd_max = arm.limits.qdd_max
    low, high = lowest_override(path, qdd_max, arm.dt), 1.0
    if low >= 1.0 or not admissible(arm, rule, latency, people, path, low, space):
        return 0.0
    for _ in range(N_HALVINGS):
        middle = 0.5 * (low + high)
        if keeps_acceleration(path, qdd_max, middle, arm.dt) and admissible(
            arm, rule, latency, people, path, middle, space
        ):
            low = middle
        else:
            high = middle
    return low
