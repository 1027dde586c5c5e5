"""Looking ahead: what comes of a policy's action, played with the policy itself, compiled.

A network knows to some centimetres whether its way is free; played forward the same way is
known to millimetres. So a decision is played ahead: the robot exactly as it moves, people as
``foretold.py`` says, the policy asked again every ``STEP_S``. Where that ends in a contact,
those of ``other_ways.py`` are played too, dashes and darts only where all before end in one.
The best way is begun, for one period. The next decision looks anew, and what is left of the
way begun is one of those looked at: it is gone on with until the policy's own way is better.

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
from app.sim.kernels.forecast import N_TIMES, STEP_S, Floats, Network, layer
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
from app.sim.kernels.reach_features import BASE_START, N_FEATURES, Obs, describe
from app.sim.kernels.reach_prospect import base_motion
from app.sim.kernels.reach_ways import N_WAYS, look_aside, put_ways
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


class Lookahead(NamedTuple):
    """Network and work space; used by one thread at a time."""

    net: Network
    """The policy, a residual actor."""
    base_weight: float
    """Share of the base motion in its action."""
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
    h1: Floats
    """First hidden layer, shape (width,)."""
    h2: Floats
    """Second hidden layer, shape (width,)."""
    act: Floats
    """Action of a step, shape (6,)."""
    found: Floats
    """First action of another way, shape (6,)."""
    begun: Floats
    """That of the best one, shape (6,)."""
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
    width = len(net.b1)

    def room(n: int) -> Floats:
        return np.zeros(n, dtype=np.float32)

    return Lookahead(
        net=net,
        base_weight=base_weight,
        foretold=new_foretold(n_envs),
        aim=aim,
        q=np.zeros(6),
        qd=np.zeros(6),
        qdd=np.zeros(6),
        c=np.zeros(6),
        d=np.zeros(6),
        obs=room(N_FEATURES + N_WAYS),
        h1=room(width),
        h2=room(width),
        act=room(6),
        found=room(6),
        begun=room(6),
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


@kernel()
def _ask(look: Lookahead) -> None:
    """Write the policy's action for ``look.obs`` into ``look.act``."""
    net = look.net
    layer(look.obs, net.w1, net.b1, True, look.h1)
    layer(look.h1, net.w2, net.b2, True, look.h2)
    layer(look.h2, net.w3, net.b3, False, look.act)
    for j in range(6):
        base = min(1.0, max(-1.0, look.obs[BASE_START + j]))
        look.act[j] = math.tanh(look.act[j] + math.atanh(look.base_weight * base))


@kernel()
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


@kernel()
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
    _ask(look)


@kernel()
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


@kernel()
def _straight(world: ReachWorld, goal: Vec, work: Work, look: Lookahead) -> None:
    """Write the action that leads the tcp straight to the goal; the robot is placed."""
    robot, prospect = work.robot, work.sight.prospect
    kinematics.tcp_jacobian(robot.rot, robot.pos, robot.tcp, robot.jacobian)
    base_motion(world.arm, robot, goal, prospect)
    for j in range(6):
        look.act[j] = max(-1.0, min(1.0, prospect.base[j]))


@kernel()
def _choose(
    world: ReachWorld,
    goal: Vec,
    time_left: float,
    step: int,
    act: Floats,
    posture: int,
    lasting: int,
    n: int,
    work: Work,
    look: Lookahead,
) -> None:
    """Write the action of a step into ``look.act``; arguments as :func:`_play`."""
    if posture == PASSED and step == 0:
        for j in range(6):
            look.act[j] = act[j]
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


@kernel()
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
    act: Floats,
    posture: int,
    lasting: int,
    kept: float,
    n: int,
    work: Work,
    look: Lookahead,
) -> tuple[int, float]:
    """Play one way: first to a posture, or ``act``, then the policy; or a dash, or a dart.

    Args:
        world: Shared data.
        rule: How actions are read.
        state: Rows.
        e: Environment.
        act: Action of the first step, where ``posture`` is PASSED; else filled with it.
        posture: Where it leads first, STRAIGHT, PASSED, or from DASH on a dash.
        lasting: For how many steps.
        kept: Share of KEPT_M that is kept from people.
        n: People.
        work: Work space.
        look: Network and work space; people are foretold. ``came`` is filled.

    Returns:
        How it ends (RUNNING, SUCCESS or COLLISION), and what it is worth.
    """
    arm, goal, least = world.arm, state.goal[e], FREE
    periods = max(1, int(STEP_S / arm.dt + 0.5))
    turned = TURNED * STEP_S * lasting if 0 <= posture < N_POSTURES else 0.0
    for j in range(6):
        look.q[j], look.qd[j], look.qdd[j] = state.q[e, j], state.qd[e, j], state.qdd[e, j]
    place_robot(arm, look.q, work.robot)
    look.came[0] = FAR
    for step in range(DART_PLAYED if posture == DART else N_PLAYED):
        left = state.time_left[e] - step * STEP_S
        if left <= 0.0:
            break
        _choose(world, goal, left, step, act, posture, lasting, n, work, look)
        if step == 0:
            for j in range(6):
                act[j] = look.act[j]
        for i in range(periods):
            advance(
                rule, look.q, look.qd, look.qdd, look.act,
                arm.q_min, arm.q_max, arm.qd_max, arm.qdd_max, arm.jerk_max, arm.dt,
                look.c, look.d, look.q, look.qd, look.qdd,
            )  # fmt: skip
            place_robot(arm, look.q, work.robot)
            share = (i + 1) / periods
            t, clear = (step + share) * STEP_S, _clear(world, step, share, n, work, look)
            least = min(least, clear)
            if _touches(arm, clear - kept * min(KEPT_M, KEPT_M_S * t), work):
                return COLLISION, AT_CONTACT + LATER * t - turned
            look.came[0] = min(look.came[0], distance_to(goal, work.robot))
            if look.came[0] < SUCCESS_DISTANCE:
                return SUCCESS, AT_GOAL - LATER * t - turned
    worth = ROOM * least - APART * distance_to(goal, work.robot) - turned
    return RUNNING, worth


@kernel()
def _best_of_others(
    world: ReachWorld,
    rule: ActionRule,
    state: ReachState,
    e: int,
    bar: float,
    n: int,
    work: Work,
    look: Lookahead,
) -> int:
    """Return the best other way that is worth more than a bar, or PASSED.

    The dashes are played where each way before ends in a contact, the darts where none is
    chosen or all end so. Its first action is written into ``look.begun``; the other arguments
    are as in :func:`_play`.
    """
    chosen = PASSED
    for k in range(N_DRAWN):
        if k == N_FIRST and bar > NO_CONTACT:
            break
        posture, lasting = way_of(k)
        _, worth = _play(
            world, rule, state, e, look.found, posture, lasting, 1.0, n, work, look
        )
        if worth > bar:
            bar, chosen = worth + BETTER, k
            copy_values(look.found, look.begun)
    if chosen != PASSED and bar > NO_CONTACT:
        return chosen
    return _best_dart(world, rule, state, e, bar, chosen, n, work, look)


@kernel()
def _best_dart(
    world: ReachWorld,
    rule: ActionRule,
    state: ReachState,
    e: int,
    bar: float,
    chosen: int,
    n: int,
    work: Work,
    look: Lookahead,
) -> int:
    """Return the number of the darts if one is worth more than a bar, else ``chosen``."""
    nearest, (posture, _) = look.nearest[e], way_of(N_DRAWN)
    random.start_stream(0, 0, look.drawn[e], look.rng)
    look.drawn[e] += 1
    if nearest[0] > 0.0:  # it is looked at again, for as long as is left of it
        nearest[1] = max(0.0, nearest[1] - (state.elapsed[e] - nearest[2]) / STEP_S)
        nearest[2] = state.elapsed[e]
    for k in range(N_DARTS):
        again, lasting = k == 0 and nearest[0] > 0.0, int(nearest[1])
        if again:
            copy_values(look.near[e], look.dart)
        elif nearest[0] > 0.0 and random.uniform(look.rng) < VARIED:
            lasting = vary_dart(world.arm, look.near[e], lasting, look.rng, look.dart)
        else:
            lasting = draw_dart(world.arm, state.q[e], look.rng, look.dart)
        _, worth = _play(
            world, rule, state, e, look.found, posture, lasting, 1.0, n, work, look
        )
        if again or nearest[0] == 0.0 or look.came[0] < nearest[0]:
            nearest[0], nearest[1] = look.came[0], lasting
            nearest[2] = state.elapsed[e]
            copy_values(look.dart, look.near[e])
        if worth > bar:
            bar, chosen = worth + BETTER, N_DRAWN
            copy_values(look.found, look.begun)
            copy_values(look.dart, look.darts[e])
            look.darting[e] = lasting
    return chosen


@kernel()
def _is_late(state: ReachState, e: int) -> bool:
    """Tell whether it is time to see if the policy waits longer than it must."""
    return bool(state.elapsed[e] >= PATIENCE_S or state.time_left[e] <= HURRY_S)


@kernel()
def _left(e: int, look: Lookahead, dt: float) -> tuple[int, int]:
    """Return what is left of the way begun in an environment, as :func:`way_of`; or PASSED."""
    k = look.plan[e, 0]
    posture, lasting = way_of(k)
    look.plan[e, 1] += 1
    gone = int(look.plan[e, 1] * dt / STEP_S + 1e-9)
    if k == PASSED or lasting <= gone:
        return way_of(PASSED)
    if posture == DART:
        copy_values(look.darts[e], look.dart)
        return posture, max(0, look.darting[e] - gone)
    return posture, lasting - gone


@kernel()
def look_ahead(
    world: ReachWorld,
    rule: ActionRule,
    state: ReachState,
    e: int,
    act: Floats,
    work: Work,
    look: Lookahead,
) -> int:
    """Keep an action, or replace it by the first one of a better way.

    Args:
        world: Shared data.
        rule: How actions are read.
        state: Rows.
        e: Environment.
        act: The policy's action, shape (6,); replaced where another way is better.
        work: Work space.
        look: Network and work space.

    Returns:
        Number of the way begun or gone on with instead, or PASSED.
    """
    look.foretold.since[e] += world.arm.dt
    if state.elapsed[e] == 0.0:
        look.plan[e, 0] = PASSED
        look.drawn[e], look.nearest[e, 0] = 0, 0.0
    n = foretell(world, state, e, work, look.foretold)
    if n == 0:
        return PASSED
    posture, lasting = way_of(PASSED)  # no literals: _play would be compiled once more for them
    ended, best = _play(world, rule, state, e, act, posture, lasting, 1.0, n, work, look)
    chosen = PASSED
    posture, lasting = _left(e, look, world.arm.dt)
    if posture != PASSED:
        played = _play(
            world, rule, state, e, look.found, posture, lasting, KEPT_ON, n, work, look
        )
        if played[1] > best:
            ended, best, chosen = played[0], played[1], look.plan[e, 0]
            copy_values(look.found, look.begun)
    looked = PASSED
    if ended == COLLISION:
        looked = _best_of_others(world, rule, state, e, best + BETTER, n, work, look)
    elif ended == RUNNING and _is_late(state, e):
        looked = _best_of_others(world, rule, state, e, WORTH_IT, n, work, look)
    if looked != PASSED:
        chosen, look.plan[e, 1] = looked, 0
    look.plan[e, 0] = chosen
    if chosen != PASSED:
        copy_values(look.begun, act)
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
        if state.outcome[e] == RUNNING:
            chosen[e] = look_ahead(world, rule, state, e, act[e], work, look)
