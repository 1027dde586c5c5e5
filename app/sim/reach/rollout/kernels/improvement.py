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

Under a safety layer that goes by measured velocities (``played_ways.py``) the other ways are
looked for wherever the policy's does not end at the goal soon, and what begins soonest to end
there is begun: mostly a dart that gets out of somebody's way in time, and back as they pass.

What is foretold promises nothing: people turn. Speed and separation monitoring (``ssm.py``) is
what keeps them safe.

Source: rollout, or policy improvement on-line: Tesauro and Galperin, *On-line policy
improvement using Monte-Carlo search* (1996); Bertsekas et al., *Rollout algorithms for
combinatorial optimization* (1997). Deviates: one forecast instead of samples, and improvement
only where it is needed.
"""

import math

import numpy as np
from numpy.typing import NDArray

from app.sim.core.jit import kernel
from app.sim.core.kernels import rng as random
from app.sim.geometry.capsules import copy_values
from app.sim.prediction.kernels.networks import STEP_S, Floats
from app.sim.reach.kernels.episode import ReachState, ReachWorld, Work
from app.sim.reach.rollout.kernels.candidates import (
    DART,
    N_DARTS,
    N_DARTS_LAYERED,
    N_DRAWN,
    N_FIRST,
    PASSED,
    VARIED,
    draw_dart,
    vary_dart,
    way_of,
)
from app.sim.reach.rollout.kernels.prediction import LONG_MOMENTS, MOMENTS, foretell
from app.sim.reach.rollout.kernels.rollout import (
    AT_GOAL,
    WAITED,
    Lookahead,
    heed_layer,
    periods_of,
    play,
)
from app.sim.robot.kernels.actions import ActionRule
from app.sim.scenario.kernels.episode import COLLISION, RUNNING

NO_CONTACT = -1.0
"""Worth more is every way that ends in no contact."""
BETTER = 0.02
"""By how much another way must be worth more than the best so far."""
WORTH_IT = 1.0
"""Worth more is every way that ends at the goal."""
PATIENCE_S, HURRY_S = 1.0, 4.0
"""Ways other than dashes are played, too, where the policy's ends neither at the goal nor in
a contact, from so long into an episode on, or when no more time than that is left [s]."""
SOON_S = 1.5
"""Under a safety layer no other way is played where one is at the goal so soon [s]."""
KEPT_ON = 0.5
"""Share of what is kept from people that counts on a way that is gone on with."""
OWN, BEGUN, FIRST_OTHER = 0, 1, 2
"""Ways in the order in which a decision plays them: the policy's own, what is left of the one
begun last, the others by their numbers."""
FIRST_DASH, FIRST_DART = FIRST_OTHER + N_FIRST, FIRST_OTHER + N_DRAWN
LAST_DART = FIRST_DART + N_DARTS_LAYERED - 1
N_LOOKED = LAST_DART + 1
"""In place of the number of a way: no more is played."""


@kernel()
def _left(e: int, look: Lookahead, dt: float) -> tuple[int, int]:
    """Return what is left of the way begun in an environment, as :func:`way_of`; or PASSED."""
    k = look.plan[e, 0]
    posture, lasting = way_of(k)
    look.plan[e, 1] += 1
    gone = look.plan[e, 1] // periods_of(dt)
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
def _keep_nearest(
    state: ReachState, e: int, k: int, lasting: int, worth: float, look: Lookahead
) -> None:
    """Keep dart ``k`` of a decision, just played, if it came nearer to the goal than others.

    Under a safety layer: if it is worth more.
    """
    nearest, lacks = look.nearest[e], look.came[0]
    if look.kept[0] > 0.0:
        lacks = AT_GOAL - worth
    if k == 0 or nearest[0] == 0.0 or lacks < nearest[0]:
        nearest[0], nearest[1], nearest[2] = lacks, lasting, state.elapsed[e]
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
    if bar == math.inf or k == FIRST_DART + N_DARTS:
        return N_LOOKED
    if k == FIRST_DASH and bar > NO_CONTACT:
        k = FIRST_DART
    if k == FIRST_DART and bar > NO_CONTACT and other:
        return N_LOOKED
    return k


@kernel()
def _next_under_layer(k: int, bar: float) -> int:
    """Return what :func:`_next_way` does, under a safety layer: dashes come last."""
    k += 1
    if bar > AT_GOAL - WAITED * SOON_S or k == FIRST_DART:
        return N_LOOKED
    if k == FIRST_DASH:
        return FIRST_DART
    if k == LAST_DART + 1:
        return N_LOOKED if bar > NO_CONTACT else FIRST_DASH
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
    other is chosen, or all end so. One loop, and one call of :func:`play`, because each call
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
                gone, kept = look.plan[e, 1] % periods_of(world.arm.dt), KEPT_ON
            end, worth = play(
                world, rule, state, e, posture, lasting, gone, kept, n, work, look
            )
            if k >= FIRST_DART:
                _keep_nearest(state, e, k - FIRST_DART, lasting, worth, look)
            if worth > bar:
                copy_values(look.found, look.begun)
                chosen, other = _begin(e, k, lasting, look), k >= FIRST_OTHER
                ended, bar = end, worth + BETTER if other else worth
        if look.kept[0] > 0.0:
            k = _next_under_layer(k, bar)
            continue
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
        if state.elapsed[e] == 0.0:
            look.plan[e, 0] = PASSED
            look.drawn[e], look.nearest[e, 0] = 0, 0.0
        layered = look.layer[0] > 0.0
        moments = LONG_MOMENTS if layered else MOMENTS
        n = foretell(world, state, e, moments, work, look.foretold)
        look.kept[0] = 0.0
        if layered:
            heed_layer(world, state, e, n, work, look)
        copy_values(act[e], look.begun)
        chosen[e] = _look_ahead(world, rule, state, e, n, work, look)
        if chosen[e] != PASSED:
            copy_values(look.begun, act[e])
