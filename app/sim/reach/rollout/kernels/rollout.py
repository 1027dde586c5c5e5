"""One way played ahead: what comes of it, beside people who do as foretold, compiled.

The robot goes exactly as it moves, people as ``foretold.py`` says, the policy is asked again
every ``STEP_S``. A way ends at the goal, in a contact, or after the steps that are played.

A contact is also who comes nearer than ``KEPT_M``, or less in the first moments, where nothing
can be done about it: what is foretold is not known to less.

**Under a safety layer** that goes by measured velocities (``ssm.py``) whoever the layer would
hold the robot for counts as a contact: who is, or will be by the time a motion that begins now
is over, nearer than the layer allows. Then ways are played for as long as a person takes to
walk past, and what they are worth is the time they take; of a way that is not at the goal by
then, the joints' way that is left, at half speed. Whom the robot is held for already is left to
the layer.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.core.kernels import rng as random
from app.sim.geometry.capsules import copy_values
from app.sim.geometry.cylinder import cylinder_clearance
from app.sim.geometry.segments import FAR
from app.sim.pick.kernels.observation import HORIZONS
from app.sim.prediction.kernels.networks import N_TIMES, STEP_S, Floats, Network
from app.sim.reach.kernels.base_controller import base_motion
from app.sim.reach.kernels.episode import ReachState, ReachWorld, Work
from app.sim.reach.kernels.observation import N_FEATURES, Obs, describe
from app.sim.reach.kernels.option_features import N_OPTION_FEATURES, look_aside, put_ways
from app.sim.reach.rollout.kernels.actor import ResidualActor, answer, new_residual_actor
from app.sim.reach.rollout.kernels.candidates import (
    DART,
    DART_PLAYED,
    DASH,
    N_POSTURES,
    PASSED,
    POSTURES,
    STOP,
    STRAIGHT,
    write_dash,
    write_toward,
)
from app.sim.reach.rollout.kernels.prediction import (
    LONG_PLAYED,
    N_PLAYED,
    Foretold,
    new_foretold,
)
from app.sim.robot.kernels import kinematics
from app.sim.robot.kernels.actions import ActionRule, Coefficients, advance
from app.sim.robot.kernels.arm import Arm, cell_clearance, place_robot, self_clearance
from app.sim.robot.kernels.joints import JointState
from app.sim.scenario.kernels.episode import (
    COLLISION,
    RUNNING,
    SUCCESS,
    SUCCESS_DISTANCE,
    distance_to,
)

AT_GOAL, AT_CONTACT, LATER, ROOM, APART, TURNED = 2.0, -2.0, 0.3, 0.3, 0.3, 0.05
"""What a way is worth: at the goal, less LATER per second; at a contact, more by it; else ROOM
per metre of the least clearance up to FREE, less APART per metre to the goal; less TURNED per
second spent on the way to a posture."""
FREE = 0.5
"""Clearance beyond which more is worth nothing [m]."""
KEPT_M, KEPT_M_S = 0.01, 0.02
"""Nearer to people than this is a contact on a way that is played: so much, or so much per
second of it where that is less [m, m/s]."""
WAITED, AT_HALF = 0.15, 0.5
"""Under a safety layer: in place of LATER, and the share of full speed at which the joints are
taken to go what is left of their way."""
DISTANCE, AHEAD = range(2)
"""Of a safety layer: how far people are kept from a robot that moves [m], and how long they go
on until a motion that is asked for now is over [s]."""
POSTURE_STEPS, POSTURE_STEP, POSTURE_NEAR = 20, 0.5, 0.02
"""How a posture at the goal is found from home: in so many steps at most, no joint by more than
so much in one [rad], until the tcp is so near to the goal [m]."""


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
    layer: Vec
    """What a safety layer asks for: DISTANCE and AHEAD; zeros without one, shape (2,)."""
    kept: Vec
    """How far they are kept in this decision [m]; 0 where the layer does not count, (1,)."""
    goal_q: Vec
    """Under the layer: a posture at the goal [rad], shape (6,)."""
    rng: random.State
    """Random stream of a decision, shape (1,)."""


def new_lookahead(arm: Arm, net: Network, base_weight: float, n_envs: int) -> Lookahead:
    """Return work space for a network and so many environments."""
    aim = np.zeros((N_POSTURES, 6))
    aim[:-1] = np.clip(arm.home + np.array(POSTURES), arm.limits.q_min, arm.limits.q_max)

    def room(n: int) -> Floats:
        return np.zeros(n, dtype=np.float32)

    return Lookahead(
        actor=new_residual_actor(net, base_weight),
        foretold=new_foretold(),
        aim=aim,
        q=np.zeros(6),
        qd=np.zeros(6),
        qdd=np.zeros(6),
        c=np.zeros(6),
        d=np.zeros(6),
        obs=room(N_FEATURES + N_OPTION_FEATURES),
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
        layer=np.zeros(2),
        kept=np.zeros(1),
        goal_q=np.zeros(6),
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


@kernel()
def _clear_at(world: ReachWorld, t: float, n: int, work: Work, look: Lookahead) -> float:
    """Return the distance of the placed robot and everybody some time from now [m]."""
    step = int(t / STEP_S)
    return _clear(world, step, t / STEP_S - step, n, work, look)


@kernel()
def _near(world: ReachWorld, t: float, n: int, work: Work, look: Lookahead) -> float:
    """Return how near people come to the placed robot, as a layer counts it [m].

    That is some time from now [s], or by when a motion that is asked for then is over.
    """
    now = _clear_at(world, t, n, work, look)
    return min(now, _clear_at(world, t + look.layer[AHEAD], n, work, look))


@kernel()
def heed_layer(
    world: ReachWorld, state: ReachState, e: int, n: int, work: Work, look: Lookahead
) -> None:
    """Fill ``look.kept`` and ``look.goal_q`` for a decision; people are foretold.

    Args:
        world: Shared data.
        state: Rows.
        e: Environment.
        n: People.
        work: Work space.
        look: Work space.
    """
    arm, robot, prospect, goal = world.arm, work.robot, work.sight.prospect, state.goal[e]
    place_robot(arm, state.q[e], robot)
    asked = look.layer[DISTANCE]
    look.kept[0] = asked if _near(world, 0.0, n, work, look) > asked else 0.0
    copy_values(arm.home, look.goal_q)
    for _ in range(POSTURE_STEPS):
        place_robot(arm, look.goal_q, robot)
        if distance_to(goal, robot) < POSTURE_NEAR:
            break
        kinematics.tcp_jacobian(robot.rot, robot.pos, robot.tcp, robot.jacobian)
        base_motion(arm, robot, goal, prospect)
        longest = POSTURE_STEP
        for j in range(6):
            longest = max(longest, abs(prospect.step[j]))
        for j in range(6):
            there = look.goal_q[j] + POSTURE_STEP / longest * prospect.step[j]
            look.goal_q[j] = max(arm.limits.q_min[j], min(arm.limits.q_max[j], there))


@kernel(inline="always")
def _straight(world: ReachWorld, goal: Vec, work: Work, look: Lookahead) -> None:
    """Write the action that leads straight to the goal; the robot is placed.

    The tcp goes straight; under a safety layer the joints do, who come back from farther away.
    """
    if look.kept[0] > 0.0:
        write_toward(world.arm, look.goal_q, look.q, look.act)
        return
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
def _room(
    world: ReachWorld, clear: float, t: float, kept: float, n: int, work: Work, look: Lookahead
) -> float:
    """Return the distance of the placed robot and everybody beyond what is kept [m].

    Args:
        world: Shared data.
        clear: Their distance [m].
        t: When that is, from now [s].
        kept: Share of KEPT_M that is kept.
        n: People.
        work: Work space.
        look: Work space.
    """
    room = clear
    if look.kept[0] > 0.0:
        room = min(clear, _near(world, t, n, work, look)) - look.kept[0]
    return room - kept * min(KEPT_M, KEPT_M_S * t)


@kernel(inline="always")
def _steps_of(posture: int, look: Lookahead) -> int:
    """Return for how many steps a way is played."""
    if look.kept[0] > 0.0 and (posture == PASSED or posture == STRAIGHT or posture == DART):
        return LONG_PLAYED
    return DART_PLAYED if posture == DART else N_PLAYED


@kernel(inline="always")
def _left_to_go(arm: Arm, look: Lookahead) -> float:
    """Return how long the joints need to the posture at the goal [s]."""
    longest = 0.0
    for j in range(6):
        longest = max(longest, abs(look.goal_q[j] - look.q[j]) / arm.limits.qd_max[j])
    return longest / AT_HALF


@kernel()
def play(
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
    periods, now = periods_of(arm.dt), 0
    layered, later = look.kept[0] > 0.0, WAITED if look.kept[0] > 0.0 else LATER
    turned = TURNED * STEP_S * lasting if 0 <= posture < N_POSTURES and not layered else 0.0
    for j in range(6):
        look.q[j], look.qd[j], look.qdd[j] = state.q[e, j], state.qd[e, j], state.qdd[e, j]
    place_robot(arm, look.q, work.robot)
    look.came[0] = FAR
    for step in range(_steps_of(posture, look)):
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
            now_at, segment = (
                JointState(look.q, look.qd, look.qdd),
                Coefficients(look.c, look.d),
            )
            advance(rule, arm.limits, arm.dt, now_at, look.act, segment, now_at)
            place_robot(arm, look.q, work.robot)
            before = now // periods
            now += 1
            t, share = now * arm.dt, now / periods - before
            clear = _clear(world, before, share, n, work, look)
            least = min(least, clear)
            if _touches(arm, _room(world, clear, t, kept, n, work, look), work):
                return COLLISION, AT_CONTACT + later * t - turned
            look.came[0] = min(look.came[0], distance_to(goal, work.robot))
            if look.came[0] < SUCCESS_DISTANCE:
                return SUCCESS, AT_GOAL - later * t - turned
    worth = ROOM * least - APART * distance_to(goal, work.robot) - turned
    if layered:
        worth = AT_GOAL - later * (now * arm.dt + _left_to_go(arm, look))
    return RUNNING, worth


@kernel(inline="always")
def periods_of(dt: float) -> int:
    """Return how many periods [s] a step is of."""
    return max(1, int(STEP_S / dt + 0.5))
