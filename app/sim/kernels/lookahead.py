"""Looking ahead: what comes of a policy's action, played with the policy itself, compiled.

A network knows to some centimetres whether its way is free; played forward the same way is
known to millimetres. So a decision is played ahead: the robot exactly as it moves, people as
``foretold.py`` says, the policy asked again every ``STEP_S``. Where that ends in a contact,
those of ``other_ways.py`` are played too, dashes and darts only where all before end in one.
The best way is begun, for one period. The next decision looks anew, and what is left of the
way begun is one of those looked at: it is gone on with until the policy's own way is better.
An action of another way is held for ``STEP_S``, as it was played: so what is gone on with ends
as it was told, beside people who do as foretold.

Later in an episode other ways are also played where the policy's leads neither to the goal nor
into a contact: it may wait longer than it must. Only one that ends at the goal is begun then.
Darts find ways around somebody who stands: most are drawn near the one that came nearest to the
goal so far, so that they get better from decision to decision.

A contact is also who comes nearer than ``KEPT_M``, or less in the first moments, where nothing
can be done about it: what is foretold is not known to less.

What is foretold promises nothing: people turn. Speed and separation monitoring (``ssm.py``) is
what keeps them safe.

Source: rollout, or policy improvement on-line: Tesauro and Galperin, *On-line policy
improvement using Monte-Carlo search* (1996); Bertsekas et al., *Rollout algorithms for
combinatorial optimization* (1997). Deviates: one forecast instead of samples, and improvement
only where it is needed.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.sim.kernels import kinematics, random
from app.sim.kernels.actions import ActionRule, advance
from app.sim.kernels.arm import Arm, cell_clearance, place_robot, self_clearance
from app.sim.kernels.columns import copy_values
from app.sim.kernels.compiled import kernel
from app.sim.kernels.cylinder import cylinder_clearance
from app.sim.kernels.episode import COLLISION, RUNNING, SUCCESS, SUCCESS_DISTANCE, distance_to
from app.sim.kernels.features import HORIZONS
from app.sim.kernels.forecast import N_TIMES, STEP_S, Floats, Network
from app.sim.kernels.foretold import N_PLAYED, Foretold, foretell, new_foretold
from app.sim.kernels.geometry import FAR
from app.sim.kernels.other_ways import (
    DART,
    DART_PLAYED,
    DASH,
    N_DARTS,
    N_DRAWN,
    N_FIRST,
    N_POSTURES,
    PASSED,
    POSTURES,
    STOP,
    STRAIGHT,
    VARIED,
    draw_dart,
    vary_dart,
    way_of,
    write_dash,
    write_toward,
)
from app.sim.kernels.reach import ReachState, ReachWorld, Work
from app.sim.kernels.reach_features import N_FEATURES, Obs, describe
from app.sim.kernels.reach_prospect import base_motion
from app.sim.kernels.reach_ways import N_WAYS, look_aside, put_ways
from app.sim.kernels.residual_actor import ResidualActor, answer, new_residual_actor
from app.sim.ports import Vec

AT_GOAL, AT_CONTACT, LATER, ROOM, APART, TURNED = 2.0, -2.0, 0.3, 0.3, 0.3, 0.05
"""What a way is worth: at the goal, less LATER per second; at a contact, more by it; else ROOM
per metre of the least clearance up to FREE, less APART per metre to the goal; less TURNED per
second spent on the way to a posture."""
NO_CONTACT = -1.0
"""Worth more is every way that ends in no contact."""
FREE = 0.5
"""Clearance beyond which more is worth nothing [m]."""
BETTER = 0.02
"""By how much another way must be worth more than the best so far."""
WORTH_IT = 1.0
"""Worth more is every way that ends at the goal."""
PATIENCE_S, HURRY_S = 1.0, 4.0
"""Ways other than dashes are played, too, where the policy's ends neither at the goal nor in
a contact, from so long into an episode on, or when no more time than that is left [s]."""
KEPT_M, KEPT_M_S = 0.01, 0.02
"""Nearer to people than this is a contact on a way that is played: so much, or so much per
second of it where that is less [m, m/s]."""
KEPT_ON = 0.5
"""Share of it that counts on a way that is gone on with."""
OWN, BEGUN, FIRST_OTHER = 0, 1, 2
"""Ways in the order in which a decision plays them: the policy's own, what is left of the one
begun last, the others by their numbers."""
FIRST_DASH, FIRST_DART = FIRST_OTHER + N_FIRST, FIRST_OTHER + N_DRAWN
N_LOOKED = FIRST_DART + N_DARTS
"""Ways that a decision plays at most."""


class Lookahead(NamedTuple):
    """Network and work space; used by one thread at a time."""

    actor: ResidualActor
    """The policy."""
    foretold: Foretold
    """Where people will be."""
    aim: Vec
    """Postures of the other ways [rad], shape (N_POSTURES, 6)."""
    q: Vec
    """Joints [rad], shape (6,)."""
    qd: Vec
    """Their speeds [rad/s], shape (6,)."""
    qdd: Vec
    """Their accelerations [rad/s^2], shape (6,)."""
    c: Vec
    """Second coefficients of a period [rad/s^2], shape (6,)."""
    d: Vec
    """Third coefficients of a period [rad/s^3], shape (6,)."""
    obs: Obs
    """What the policy sees, shape (n_obs,)."""
    act: Floats
    """Action of a step, shape (6,)."""
    found: Floats
    """First action of the way played last, shape (6,)."""
    begun: Floats
    """The policy's action, and then that of the best way so far, shape (6,)."""
    last: Floats
    """Actions of the period before, shape (n_envs, 6)."""
    plan: NDArray[np.int64]
    """Number of the way that was begun last, or PASSED, and for how many decisions it has been
    gone on with, shape (n_envs, 2)."""
    came: Vec
    """How near to the goal the way played last came [m], shape (1,)."""
    dart: Vec
    """Where the dart that is played leads first [rad], shape (6,)."""
    darts: Vec
    """The same of those begun last, shape (n_envs, 6)."""
    darting: NDArray[np.int64]
    """For how many steps they lead there, shape (n_envs,)."""
    near: Vec
    """The same of those that came nearest to the goal, shape (n_envs, 6)."""
    nearest: Vec
    """How near that was [m], 0 where there is none yet; for how many steps they lead there, and
    since when in the episode [s], shape (n_envs, 3)."""
    drawn: NDArray[np.int64]
    """Decisions that drew darts in the present episodes, shape (n_envs,)."""
    rng: random.State
    """Random stream of a decision, shape (1,)."""


def new_lookahead(arm: Arm, net: Network, base_weight: float, n_envs: int) -> Lookahead:
    """Return work space for a network and so many environments."""
    aim = np.zeros((N_POSTURES, 6))
    aim[:-1] = np.clip(arm.home + np.array(POSTURES), arm.q_min, arm.q_max)

    def room(n: int) -> Floats:
        return np.zeros(n, dtype=np.float32)

    return Lookahead(
        actor=new_residual_actor(net, base_weight),
        foretold=new_foretold(n_envs),
        aim=aim,
        q=np.zeros(6),
        qd=np.zeros(6),
        qdd=np.zeros(6),
        c=np.zeros(6),
        d=np.zeros(6),
        obs=room(N_FEATURES + N_WAYS),
        act=room(6),
        found=room(6),
        begun=room(6),
        last=np.zeros((n_envs, 6), dtype=np.float32),
        plan=np.full((n_envs, 2), PASSED),
        came=np.zeros(1),
        dart=np.zeros(6),
        darts=np.zeros((n_envs, 6)),
        darting=np.zeros(n_envs, dtype=np.int64),
        near=np.zeros((n_envs, 6)),
        nearest=np.zeros((n_envs, 3)),
        drawn=np.zeros(n_envs, dtype=np.int64),
        rng=np.zeros(1, dtype=np.uint64),
    )


@kernel(inline="always")
def _see(world: ReachWorld, step: int, n: int, work: Work, look: Lookahead) -> float:
    """Fill what is seen of the people at a step; return how near the placed robot is [m]."""
    robot, sight, ways, top = work.robot, work.sight, work.ways, world.people.top_z
    places, nearest, who = look.foretold.places, FAR, 0
    for i in range(3):
        sight.ahead[i] = FAR
    for p in range(n):
        x, y, r = places[step, p, 0], places[step, p, 1], places[step, p, 2]
        d, _ = cylinder_clearance(robot.columns, 0, x, y, r, top)
        if d < nearest:
            nearest, who = d, p
        vx = (places[step + 1, p, 0] - x) / STEP_S
        vy = (places[step + 1, p, 1] - y) / STEP_S
        for i in range(3):
            there_x, there_y = x + HORIZONS[i] * vx, y + HORIZONS[i] * vy
            d, _ = cylinder_clearance(robot.columns, 0, there_x, there_y, r, top)
            sight.ahead[i] = min(sight.ahead[i], d)
        for i in range(N_TIMES):
            for m in range(3):
                ways.ahead[i, p, m] = places[step + 1 + i, p, m]
    for m in range(2):
        sight.seen[m] = places[step, who, m]
        sight.seen[2 + m] = (places[step + 1, who, m] - places[step, who, m]) / STEP_S
    sight.seen[4] = places[step, who, 2]
    sight.seen[5] = (places[step + 1, who, 2] - places[step, who, 2]) / STEP_S
    ways.number[0], ways.number[1] = n, who
    return nearest


@kernel(inline="always")
def _ask_at(
    world: ReachWorld,
    goal: Vec,
    time_left: float,
    step: int,
    n: int,
    work: Work,
    look: Lookahead,
) -> None:
    """Write the policy's action at a step into ``look.act``; the robot is placed."""
    arm, top, robot, sight = world.arm, world.people.top_z, work.robot, work.sight
    near = _see(world, step, n, work, look)
    look_aside(arm, top, look.q, look.qd, work.ways)
    describe(arm, top, look.q, look.qd, goal, near, time_left, robot, sight, look.obs)
    put_ways(
        arm, top, look.q, look.qd, sight.seen, goal, robot, sight.prospect, work.ways,
        N_FEATURES, look.obs,
    )  # fmt: skip
    answer(look.actor, look.obs, look.act)


@kernel(inline="always")
def _clear(
    world: ReachWorld, step: int, share: float, n: int, work: Work, look: Lookahead
) -> float:
    """Return the distance of the placed robot and everybody between two steps [m]."""
    least, places = FAR, look.foretold.places
    for p in range(n):
        a, b = places[step, p], places[step + 1, p]
        x, y = a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])
        r = a[2] + share * (b[2] - a[2])
        d, _ = cylinder_clearance(work.robot.columns, 0, x, y, r, world.people.top_z)
        least = min(least, d)
    return least


@kernel(inline="always")
def _straight(world: ReachWorld, goal: Vec, work: Work, look: Lookahead) -> None:
    """Write the action that leads the tcp straight to the goal; the robot is placed."""
    robot, prospect = work.robot, work.sight.prospect
    kinematics.tcp_jacobian(robot.rot, robot.pos, robot.tcp, robot.jacobian)
    base_motion(world.arm, robot, goal, prospect)
    for j in range(6):
        look.act[j] = max(-1.0, min(1.0, prospect.base[j]))


@kernel(inline="always")
def _choose(
    world: ReachWorld,
    goal: Vec,
    time_left: float,
    step: int,
    posture: int,
    lasting: int,
    n: int,
    work: Work,
    look: Lookahead,
) -> None:
    """Write the action of a step into ``look.act``; arguments as :func:`_play`."""
    if posture == PASSED and step == 0:
        copy_values(look.begun, look.act)
    elif posture == DART and step < lasting:
        write_toward(world.arm, look.dart, look.q, look.act)
    elif posture == DART or (posture == STRAIGHT and step < lasting):
        _straight(world, goal, work, look)
    elif posture >= DASH:
        write_dash(posture - DASH, step < lasting, look.act)
    elif posture == PASSED or step >= lasting:
        _ask_at(world, goal, time_left, step, n, work, look)
    elif posture == STOP:
        look.act[:] = 0.0
    else:
        write_toward(world.arm, look.aim[posture], look.q, look.act)


@kernel(inline="always")
def _touches(arm: Arm, clear: float, work: Work) -> bool:
    """Tell whether the placed robot touches somebody, the cell or itself."""
    return bool(
        clear <= 0.0
        or cell_clearance(arm, work.robot.columns)[0] <= 0.0
        or self_clearance(arm, work.robot)[0] <= 0.0
    )


@kernel()
def _play(
    world: ReachWorld,
    rule: ActionRule,
    state: ReachState,
    e: int,
    posture: int,
    lasting: int,
    gone: int,
    kept: float,
    n: int,
    work: Work,
    look: Lookahead,
) -> tuple[int, float]:
    """Play one way: first to a posture, or as begun, then the policy; or a dash, or a dart.

    Args:
        world: Shared data.
        rule: How actions are read.
        state: Rows.
        e: Environment.
        posture: Where it leads first, STRAIGHT, PASSED for the action in ``look.begun``, or
            from DASH on a dash.
        lasting: For how many steps.
        gone: Periods of the first step that are over: the action of the last one goes on.
        kept: Share of KEPT_M that is kept from people.
        n: People.
        work: Work space.
        look: Network and work space; people are foretold. ``came`` is filled, and ``found``
            with the action of the first step.

    Returns:
        How it ends (RUNNING, SUCCESS or COLLISION), and what it is worth.
    """
    arm, goal, least = world.arm, state.goal[e], FREE
    periods, now = _periods(arm.dt), 0
    turned = TURNED * STEP_S * lasting if 0 <= posture < N_POSTURES else 0.0
    for j in range(6):
        look.q[j], look.qd[j], look.qdd[j] = state.q[e, j], state.qd[e, j], state.qdd[e, j]
    place_robot(arm, look.q, work.robot)
    look.came[0] = FAR
    for step in range(DART_PLAYED if posture == DART else N_PLAYED):
        left = state.time_left[e] - step * STEP_S
        if left <= 0.0:
            break
        if step == 0 and gone > 0:
            copy_values(look.last[e], look.act)
        else:
            _choose(world, goal, left, step, posture, lasting, n, work, look)
        if step == 0:
            copy_values(look.act, look.found)
        for _ in range(gone if step == 0 else 0, periods):
            advance(
                rule, look.q, look.qd, look.qdd, look.act,
                arm.q_min, arm.q_max, arm.qd_max, arm.qdd_max, arm.jerk_max, arm.dt,
                look.c, look.d, look.q, look.qd, look.qdd,
            )  # fmt: skip
            place_robot(arm, look.q, work.robot)
            before = now // periods
            now += 1
            t, share = now * arm.dt, now / periods - before
            clear = _clear(world, before, share, n, work, look)
            least = min(least, clear)
            if _touches(arm, clear - kept * min(KEPT_M, KEPT_M_S * t), work):
                return COLLISION, AT_CONTACT + LATER * t - turned
            look.came[0] = min(look.came[0], distance_to(goal, work.robot))
            if look.came[0] < SUCCESS_DISTANCE:
                return SUCCESS, AT_GOAL - LATER * t - turned
    worth = ROOM * least - APART * distance_to(goal, work.robot) - turned
    return RUNNING, worth


@kernel(inline="always")
def _periods(dt: float) -> int:
    """Return how many periods [s] a step is of."""
    return max(1, int(STEP_S / dt + 0.5))


@kernel()
def _left(e: int, look: Lookahead, dt: float) -> tuple[int, int]:
    """Return what is left of the way begun in an environment, as :func:`way_of`; or PASSED."""
    k = look.plan[e, 0]
    posture, lasting = way_of(k)
    look.plan[e, 1] += 1
    gone = look.plan[e, 1] // _periods(dt)
    if k == PASSED or lasting <= gone:
        return way_of(PASSED)
    if posture == DART:
        copy_values(look.darts[e], look.dart)
        return posture, max(0, look.darting[e] - gone)
    return posture, lasting - gone


@kernel(inline="always")
def _aim_dart(world: ReachWorld, state: ReachState, e: int, k: int, look: Lookahead) -> int:
    """Draw dart ``k`` of a decision; return for how many steps it leads away.

    The first is the one that came nearest to the goal so far, for as long as is left of it.
    """
    nearest = look.nearest[e]
    if k == 0:
        random.start_stream(0, 0, look.drawn[e], look.rng)
        look.drawn[e] += 1
        if nearest[0] > 0.0:
            nearest[1] = max(0.0, nearest[1] - (state.elapsed[e] - nearest[2]) / STEP_S)
            nearest[2] = state.elapsed[e]
            copy_values(look.near[e], look.dart)
            return int(nearest[1])
    if nearest[0] > 0.0 and random.uniform(look.rng) < VARIED:
        return vary_dart(world.arm, look.near[e], int(nearest[1]), look.rng, look.dart)
    return draw_dart(world.arm, state.q[e], look.rng, look.dart)


@kernel(inline="always")
def _keep_nearest(state: ReachState, e: int, k: int, lasting: int, look: Lookahead) -> None:
    """Keep dart ``k`` of a decision, just played, if it came nearer to the goal than others."""
    nearest = look.nearest[e]
    if k == 0 or nearest[0] == 0.0 or look.came[0] < nearest[0]:
        nearest[0], nearest[1], nearest[2] = look.came[0], lasting, state.elapsed[e]
        copy_values(look.dart, look.near[e])


@kernel(inline="always")
def _way_at(
    world: ReachWorld, state: ReachState, e: int, k: int, look: Lookahead
) -> tuple[int, int]:
    """Return the way that is played as number ``k`` of a decision, as :func:`way_of`."""
    if k == BEGUN:
        return _left(e, look, world.arm.dt)
    if k >= FIRST_DART:
        return DART, _aim_dart(world, state, e, k - FIRST_DART, look)
    return way_of(PASSED if k == OWN else k - FIRST_OTHER)


@kernel()
def _bar_for_others(state: ReachState, e: int, ended: int, worth: float) -> float:
    """Return what other ways must be worth; infinite where none is looked for.

    Args:
        state: Rows.
        e: Environment.
        ended: How the best way so far ends: the policy's own, or what is left of the one begun.
        worth: What it is worth.
    """
    if ended == COLLISION:
        return worth + BETTER
    late = state.elapsed[e] >= PATIENCE_S or state.time_left[e] <= HURRY_S
    return WORTH_IT if ended == RUNNING and late else math.inf


@kernel()
def _next_way(k: int, bar: float, other: bool) -> int:
    """Return which way is played after number ``k``; N_LOOKED for none.

    Args:
        k: Number of the way played.
        bar: What others must be worth.
        other: Whether one of them is chosen already.
    """
    k += 1
    if bar == math.inf:
        return N_LOOKED
    if k == FIRST_DASH and bar > NO_CONTACT:
        k = FIRST_DART
    if k == FIRST_DART and bar > NO_CONTACT and other:
        return N_LOOKED
    return k


@kernel(inline="always")
def _begin(e: int, k: int, lasting: int, look: Lookahead) -> int:
    """Note that a way, by its place in the order, is the best so far; return its number."""
    if k == OWN:
        return PASSED
    if k == BEGUN:
        return int(look.plan[e, 0])
    look.plan[e, 1] = 0
    if k < FIRST_DART:
        return k - FIRST_OTHER
    copy_values(look.dart, look.darts[e])
    look.darting[e] = lasting
    return N_DRAWN


@kernel(inline="always")
def _look_ahead(
    world: ReachWorld,
    rule: ActionRule,
    state: ReachState,
    e: int,
    n: int,
    work: Work,
    look: Lookahead,
) -> int:
    """Choose the way begun in an environment; return its number, or PASSED.

    The policy's own way and what is left of the one begun last are always played; others where
    that ends in a contact, or late; dashes where each before ends in a contact; darts where no
    other is chosen, or all end so. One loop, and one call of :func:`_play`, because each call
    would be optimised as a whole and cost half a minute of compilation.

    Args:
        world: Shared data.
        rule: How actions are read.
        state: Rows.
        e: Environment.
        n: People, who are foretold.
        work: Work space.
        look: Network and work space; ``begun`` holds the policy's action, and then that of the
            way chosen.
    """
    k, chosen, other, ended, bar = OWN, PASSED, False, RUNNING, -math.inf
    while k < N_LOOKED:
        posture, lasting = _way_at(world, state, e, k, look)
        if k != BEGUN or posture != PASSED:
            gone, kept = 0, 1.0
            if k == BEGUN:
                gone, kept = look.plan[e, 1] % _periods(world.arm.dt), KEPT_ON
            end, worth = _play(
                world, rule, state, e, posture, lasting, gone, kept, n, work, look
            )
            if k >= FIRST_DART:
                _keep_nearest(state, e, k - FIRST_DART, lasting, look)
            if worth > bar:
                copy_values(look.found, look.begun)
                chosen, other = _begin(e, k, lasting, look), k >= FIRST_OTHER
                ended, bar = end, worth + BETTER if other else worth
        if k == BEGUN:
            bar = _bar_for_others(state, e, ended, bar)
        k = _next_way(k, bar, other)
    look.plan[e, 0] = chosen
    copy_values(look.begun, look.last[e])
    return chosen


@kernel(nogil=True)
def look_ahead_batch(
    world: ReachWorld,
    rule: ActionRule,
    state: ReachState,
    act: Floats,
    work: Work,
    look: Lookahead,
    chosen: NDArray[np.int64],
) -> None:
    """Look ahead in every environment whose episode goes on.

    Args:
        world: Shared data.
        rule: How actions are read.
        state: Rows.
        act: Actions, shape (n_envs, 6); replaced where another way is better.
        work: Work space.
        look: Network and work space.
        chosen: Filled with the number of the way begun instead, or PASSED, shape (n_envs,).
    """
    for e in range(state.q.shape[0]):
        chosen[e] = PASSED
        if state.outcome[e] != RUNNING:
            continue
        look.foretold.since[e] += world.arm.dt
        if state.elapsed[e] == 0.0:
            look.plan[e, 0] = PASSED
            look.drawn[e], look.nearest[e, 0] = 0, 0.0
        n = foretell(world, state, e, work, look.foretold)
        copy_values(act[e], look.begun)
        chosen[e] = _look_ahead(world, rule, state, e, n, work, look)
        if chosen[e] != PASSED:
            copy_values(look.begun, act[e])
