"""Bounds of cubic, jerk-limited trajectories of one joint, compiled (docs/method.md 2.2).

During one period of length ``T`` a joint follows ``q(x) = q + qd x + qdd/2 x^2 + j/6 x^3``. The
free number is the jerk ``j``, six times the leading coefficient; acceleration continues from
period to period. With the limits ``A`` of acceleration and ``J`` of jerk, the admissible jerks
are an interval. Its ends are the last jerks after which a braking manoeuvre still comes to rest
inside all limits; they are found by bisection on what that manoeuvre exceeds.

**The manoeuvre** is a feedback law, the sampled joint's shortest stop. With ``s = J T`` and

    y = qd + qdd T/2                            speed half a period ahead
    F(a) = a + (a - s) + (a - 2s) + ...         while positive; odd in a

the next acceleration is ``G(y) = F^-1(-y/T)``, from which a ramp by ``s`` a period comes to
rest exactly, clipped to ``[-A, A]`` and to ``qdd -+ s``. It is a ramp of ``n`` full steps,
``h`` periods at the acceleration limit and a ramp to zero: how far and how fast the joint goes,
also inside the periods, has a closed form. With ``qd - qd_target`` for ``qd`` the same law
settles at a wanted speed.

**Why it holds.** The ``y`` of successive periods are the control points of uniform B-splines,
quadratic for ``qd(t)`` and cubic for ``q(t)``, whose weights are positive; and under the law
the greater of two states (in ``q``, ``qd - qdd T/2`` and ``qdd``) stays the greater for ever. A
greater jerk gives such a state: so limits above bound ``j`` from above, limits below bound it
from below, and all between is admissible. One period on, the law gives the manoeuvre's own
tail, so its first jerk is admissible from every viable state: the interval is never empty, and
the last verified manoeuvre is at hand as the fallback without being stored. At rest inside its
limits a joint is viable. To come to rest before a limit is a little more cautious than need be:
a stop that swings back from it would be shorter.

Source: docs/method.md 2.2; the law is the sampled time-optimal one of R. Zanasi, C. Guarino
Lo Bianco and A. Tonielli, "Nonlinear filters for the generation of smooth trajectories",
Automatica 36, 2000, with a limit on acceleration.
Deviates: the thesis (docs/method.md 2.2) names degrees up to 5 and bounds only degree 2.
"""

import math

from app.sim.core.jit import kernel
from app.sim.robot.kernels.joints import AxisLimits, AxisState

SLACK = 1e-12
"""Excess over a limit that is taken for rounding when a jerk is judged [rad, rad/s]."""
UNFEASIBLE = 1e-10
"""Excess of the manoeuvre itself from which a state counts as not viable [rad, rad/s]."""
JERK_RESOLUTION = 1e-9
"""Width at which the search for an end of the interval stops, as a share of the jerk limit."""
MAX_SEARCH = 60
"""Most manoeuvres tried per end."""


@kernel(error_model="numpy")
def ramp_sum(a: float, step: float) -> float:
    """Return ``a + (a - step) + (a - 2 step) + ...`` while positive [rad/s^2], ``a >= 0``."""
    n = math.floor(a / step)
    return (n + 1.0) * (a - 0.5 * step * n)


@kernel(error_model="numpy")
def ramp_start(total: float, step: float) -> tuple[float, float]:
    """Return start and number of full steps of a ramp with a given sum.

    Args:
        total: Sum of the ramp's accelerations [rad/s^2], at least 0.
        step: Change of acceleration per period [rad/s^2].
    """
    n = math.floor(0.5 * (math.sqrt(1.0 + 8.0 * total / step) - 1.0))
    return (total + 0.5 * step * n * (n + 1.0)) / (n + 1.0), n


@kernel(error_model="numpy")
def settling_jerk(qd_off: float, qdd: float, acc: float, jerk: float, dt: float) -> float:
    """Return the jerk of the shortest way to a speed at zero acceleration [rad/s^3].

    Args:
        qd_off: Speed less the wanted one [rad/s]; the speed itself to brake.
        qdd: Acceleration [rad/s^2].
        acc: Acceleration limit [rad/s^2].
        jerk: Jerk limit [rad/s^3].
        dt: Period [s].
    """
    step = jerk * dt
    y = qd_off + 0.5 * dt * qdd
    wanted = -math.copysign(ramp_start(abs(y) / dt, step)[0], y)
    a = min(acc, max(-acc, wanted))
    a = min(qdd + step, max(qdd - step, a))
    return min(jerk, max(-jerk, (a - qdd) / dt))


@kernel(error_model="numpy")
def ramp_steps(qdd: float, y: float, acc: float, step: float, dt: float) -> float:
    """Return the number of full steps down at the start of the manoeuvre.

    A step from ``a`` to ``b = a - step`` is full while ``b >= -acc`` and ``y/T + F(b) > 0``:
    even after it the ramp to zero would not brake enough. The left side stays the same while
    ``b >= step`` and then falls by ``2 |b| + step`` per step.

    Args:
        qdd: Acceleration [rad/s^2].
        y: Speed half a period ahead [rad/s].
        acc: Acceleration limit [rad/s^2].
        step: Change of acceleration per period [rad/s^2].
        dt: Period [s].
    """
    b, n = qdd - step, 0.0
    over = y / dt + math.copysign(ramp_sum(abs(b), step), b)
    if over <= 0.0:
        return 0.0
    if b >= 0.0:
        n = math.floor(b / step) + 1.0
        b -= n * step
        over += b  # b = r - step with 0 <= r < step: F falls from r to -(step - r)
    below = -b
    if over <= 0.0 or below > acc:
        return n
    most = math.floor((acc - below) / step) + 1.0
    needed = over / (math.sqrt(below * below + step * over) + below)
    return n + min(most, math.ceil(needed))


@kernel(error_model="numpy")
def lowest_turn(qd: float, qdd: float, jerk: float, longest: float) -> float:
    """Return the displacement at which a joint that moves down reverses [rad].

    Args:
        qd: Speed [rad/s], negative.
        qdd: Acceleration [rad/s^2].
        jerk: Constant jerk [rad/s^3].
        longest: Time by which it has turned, but for rounding [s].
    """
    toward = qdd + math.sqrt(max(qdd * qdd - 2.0 * jerk * qd, 0.0))
    x = min(longest, -2.0 * qd / toward) if toward > 0.0 else longest
    return x * (qd + x * (0.5 * qdd + x * jerk / 6.0))


@kernel(error_model="numpy")
def _from_above(
    qd: float, qdd: float, y: float, acc: float, jerk: float, dt: float
) -> tuple[float, float, float, float]:
    """Return the manoeuvre's extremes if it comes to rest from positive speed.

    Arguments and results as :func:`manoeuvre_extremes`, and ``y`` [rad/s]. The end is the
    highest point; the lowest is where the joint turns up, if it goes down at first. The sums
    are those of the B-spline's control points: ``T (y_-1 + 5 y_0)/6 + T (y_1 + y_2 + ...)``.
    """
    step = jerk * dt
    n = ramp_steps(qdd, y, acc, step, dt)
    qdd_n = qdd - n * step
    y_n = y + dt * n * (qdd - 0.5 * step * (n + 1.0))
    total = n * y + dt * n * (n + 1.0) * (0.5 * qdd - step * (n + 2.0) / 6.0)
    y_m, next_qdd = y_n, -acc
    over = y_n - dt * ramp_sum(acc, step)
    if over > 0.0:
        h = math.ceil(over / (dt * acc))
        total += h * (y_n - 0.5 * dt * acc * (h + 1.0))
        y_m = y_n - h * dt * acc
    b, p = ramp_start(max(y_m, 0.0) / dt, step)
    if over <= 0.0:
        next_qdd = -b
    total += dt * p * (p + 1.0) * (0.5 * (b - p * step) + step * (p - 1.0) / 6.0)
    end = dt * ((qd - 0.5 * dt * qdd + 5.0 * y) / 6.0 + total)
    fastest, lowest = max(qd, 0.0), 0.0
    if qdd > 0.0:
        if qdd_n <= 0.0:
            fastest = max(0.0, qd + 0.5 * qdd * qdd / jerk)
        else:
            rest = 0.5 * qdd_n * qdd_n * dt / (qdd_n - next_qdd)
            fastest = max(0.0, y_n - 0.5 * dt * qdd_n + rest)
    if qd < 0.0:
        x = n * dt
        qd_n = qd + x * (qdd - 0.5 * jerk * x)
        if qd_n >= 0.0:
            lowest = lowest_turn(qd, qdd, -jerk, x)
        else:
            down = x * (qd + x * (0.5 * qdd - x * jerk / 6.0))
            lowest = down + lowest_turn(qd_n, qdd_n, (next_qdd - qdd_n) / dt, dt)
    return min(lowest, 0.0), max(end, 0.0), min(qd, 0.0), fastest


@kernel(error_model="numpy")
def manoeuvre_extremes(
    qd: float, qdd: float, acc: float, jerk: float, dt: float
) -> tuple[float, float, float, float]:
    """Return the largest position and speed of a joint that brakes from now on.

    Args:
        qd: Speed [rad/s].
        qdd: Acceleration [rad/s^2], within its limit.
        acc: Acceleration limit [rad/s^2].
        jerk: Jerk limit [rad/s^3].
        dt: Period [s].

    Returns:
        Least and greatest displacement [rad], least and greatest speed [rad/s].
    """
    y = qd + 0.5 * dt * qdd
    step = jerk * dt
    wanted = -math.copysign(ramp_start(abs(y) / dt, step)[0], y)
    down = qdd - step > wanted
    up = qdd + step < wanted
    if down or (y >= 0.0 and not up):
        return _from_above(qd, qdd, y, acc, jerk, dt)
    high, low, fastest, slowest = _from_above(-qd, -qdd, -y, acc, jerk, dt)
    return -low, -high, -slowest, -fastest


@kernel(error_model="numpy")
def period_extremes(
    qd: float, qdd: float, jerk: float, dt: float
) -> tuple[float, float, float, float]:
    """Return least and greatest displacement [rad] and speed [rad/s] after the start.

    The start itself does not count: no jerk can change it.

    Args:
        qd: Speed at the start [rad/s].
        qdd: Acceleration at the start [rad/s^2].
        jerk: Constant jerk [rad/s^3].
        dt: Period [s].
    """
    qd_end = qd + dt * (qdd + 0.5 * dt * jerk)
    end = dt * (qd + dt * (0.5 * qdd + dt * jerk / 6.0))
    low, high, slowest, fastest = end, end, qd_end, qd_end
    if qdd * (qdd + dt * jerk) < 0.0:
        turn = qd - 0.5 * qdd * qdd / jerk
        slowest, fastest = min(slowest, turn), max(fastest, turn)
    if min(qd, slowest) < 0.0 < max(qd, fastest):
        root = math.sqrt(max(qdd * qdd - 2.0 * jerk * qd, 0.0))
        s = -(qdd + math.copysign(root, qdd))  # the roots of qd(x): 2 qd/s and s/jerk
        for k in range(2):
            x = 2.0 * qd / s if k == 0 else s / jerk
            if 0.0 < x < dt:
                q = x * (qd + x * (0.5 * qdd + x * jerk / 6.0))
                low, high = min(low, q), max(high, q)
    return low, high, slowest, fastest


@kernel(error_model="numpy")
def excesses(j: float, at: AxisState, to: AxisLimits) -> tuple[float, float]:
    """Return the excess over limits of a jerk for one period with braking afterwards.

    Args:
        j: Jerk of this period [rad/s^3].
        at: State of the joint.
        to: Limits of the joint.

    Returns:
        The greater of position [rad] and speed [rad/s] excess, below and above; not positive
        where the limits hold for ever.
    """
    dt = to.dt
    q, qd, qdd = at
    low, high, slowest, fastest = period_extremes(qd, qdd, j, dt)
    move = dt * (qd + dt * (0.5 * qdd + dt * j / 6.0))
    later = manoeuvre_extremes(
        qd + dt * (qdd + 0.5 * dt * j), qdd + dt * j, to.qdd_max, to.jerk_max, dt
    )
    low, high = q + min(low, move + later[0]), q + max(high, move + later[1])
    slowest, fastest = min(slowest, later[2]), max(fastest, later[3])
    below = max(to.q_min - low, -to.qd_max - slowest)
    return below, max(high - to.q_max, fastest - to.qd_max)


@kernel(error_model="numpy")
def farthest_jerk(
    side: int,
    braking: float,
    e_braking: float,
    wanted: float,
    e_wanted: float,
    at: AxisState,
    to: AxisLimits,
) -> float:
    """Return the admissible jerk nearest to a target, searched from braking [rad/s^3].

    Bisection, with the cut where a straight line through the excesses (one of them halved when
    the same end stays twice) crosses zero; every third cut is in the middle. What is returned
    was itself found admissible.

    Args:
        side: 0 toward the limits below, 1 above.
        braking: Jerk of the braking manoeuvre [rad/s^3], admissible.
        e_braking: Its excess on that side, not positive but for rounding.
        wanted: Wanted jerk [rad/s^3], beyond which nothing is tried.
        e_wanted: Its excess, positive.
        at: State of the joint.
        to: Limits of the joint.
    """
    good, bad = braking, wanted
    weight_good, weight_bad, last = min(e_braking, -SLACK), e_wanted, 0
    for k in range(MAX_SEARCH):
        if abs(bad - good) <= JERK_RESOLUTION * to.jerk_max:
            break
        share = 0.5 if k % 3 == 2 else weight_good / (weight_good - weight_bad)
        j = good + min(0.999, max(0.001, share)) * (bad - good)
        e = excesses(j, at, to)[side]
        if e <= 0.0:
            if last > 0:
                weight_bad *= 0.5
            good, weight_good, last = j, e, 1
        else:
            if last < 0:
                weight_good *= 0.5
            bad, weight_bad, last = j, e, -1
    return good


@kernel(error_model="numpy")
def jerk_interval(at: AxisState, to: AxisLimits) -> tuple[float, float, bool]:
    """Return the least and the greatest admissible jerk [rad/s^3].

    Args:
        at: State of the joint.
        to: Limits of the joint.

    Returns:
        The ends [rad/s^3] and whether the interval is empty: from a state that is not viable;
        both ends are then the braking jerk.
    """
    qd, qdd = at.qd, at.qdd
    braking = settling_jerk(qd, qdd, to.qdd_max, to.jerk_max, to.dt)
    below, above = excesses(braking, at, to)
    if max(below, above, abs(qdd) - to.qdd_max) > UNFEASIBLE:
        return braking, braking, True
    j_min = max(-to.jerk_max, (-to.qdd_max - qdd) / to.dt)
    j_max = min(to.jerk_max, (to.qdd_max - qdd) / to.dt)
    e_min = excesses(j_min, at, to)[0]
    e_max = excesses(j_max, at, to)[1]
    if e_min > SLACK:
        j_min = farthest_jerk(0, braking, below, j_min, e_min, at, to)
    if e_max > SLACK:
        j_max = farthest_jerk(1, braking, above, j_max, e_max, at, to)
    return min(j_min, braking), max(j_max, braking), False


@kernel(error_model="numpy")
def jerk_for_speed(at: AxisState, qd_target: float, to: AxisLimits) -> tuple[float, bool]:
    """Return the admissible jerk nearest to the shortest way to a wanted speed [rad/s^3].

    That way ends at the speed with zero acceleration, without overshoot, so that holding a
    target settles in finite time. It is tried first; an end of the interval is looked for only
    where it is not admissible.

    Args:
        at: State of the joint.
        qd_target: Wanted speed [rad/s].
        to: Limits of the joint.

    Returns:
        The jerk [rad/s^3] and whether the interval is empty; it brakes then.
    """
    qd, qdd = at.qd, at.qdd
    wanted = settling_jerk(qd - qd_target, qdd, to.qdd_max, to.jerk_max, to.dt)
    below, above = excesses(wanted, at, to)
    if max(below, above) <= SLACK and abs(qdd) <= to.qdd_max + SLACK:
        return wanted, False
    braking = settling_jerk(qd, qdd, to.qdd_max, to.jerk_max, to.dt)
    low, high = excesses(braking, at, to)
    if max(low, high, abs(qdd) - to.qdd_max) > UNFEASIBLE:
        return braking, True
    if wanted > braking and above > SLACK:
        return farthest_jerk(1, braking, high, wanted, above, at, to), False
    if wanted < braking and below > SLACK:
        return farthest_jerk(0, braking, low, wanted, below, at, to), False
    return wanted, False
