"""Ways to move the robot by one trained policy: directly, between targets, beside people.

direct                  the policy on its own observation; of several people it sees the nearest
interpolated            the mean of its actions for the training targets around the goal
averaged                the mean over people of its actions beside each of them alone
averaged-interpolated   both
...-ahead               any of them, played ahead with the policy, and changed where that ends
                        in a contact (``lookahead.py``)

A mover looks at a batch as it is and gives an action for every cell in it. The policy need not
have met more than one person in training.

Source: METHOD 2.4; for several people the outlook of thesis 4.5, "deploying a policy for each
person inside the robot workspace and then averaging the action based on the distance between
human and robot", which leaves the weights open.
"""

from typing import Literal, Protocol, get_args

import numpy as np
from numpy.typing import NDArray

from app.errors import CheckpointMismatch, InvalidInput
from app.policies.inference.rollout import NO_LAYER, Layer, Lookahead, looks_ahead
from app.policies.inference.target_interpolation import Interpolation, interpolates
from app.sim.core.arrays import Vec
from app.sim.reach.batch import ReachBatch
from app.sim.reach.reach_actor import ReachActor
from app.sim.scenario.kernels.episode import RUNNING

How = Literal[
    "direct",
    "interpolated",
    "averaged",
    "averaged-interpolated",
    "direct-ahead",
    "interpolated-ahead",
    "averaged-ahead",
    "averaged-interpolated-ahead",
]
HOWS: tuple[How, ...] = get_args(How)
"""Names of the ways."""
AHEAD = "-ahead"
"""End of the names of those that look ahead."""
NEAREST_M = 0.05
"""People nearer than this weigh no more [m]."""
POWER = 2.0
"""Weights of people fall with this power of their distance."""
Actions = NDArray[np.float32]
Rows = NDArray[np.int64]


class Controller(Protocol):
    """Moves the robots of a batch."""

    def acts(self, batch: ReachBatch) -> Actions:
        """Return actions in [-1, 1] for every cell, shape (n_envs, 6); 0 where it has ended."""


class Asked(Protocol):
    """A policy asked beside people who are there, or beside one of them alone."""

    def ask(self, batch: ReachBatch, rows: Rows, who: int | None) -> Actions:
        """Return actions, shape (k, 6).

        Args:
            batch: Cells.
            rows: Which of them, shape (k,).
            who: The person who is there alone; None for all as they are.
        """


class Direct:
    """The policy on its own observation.

    Args:
        actor: A policy.
    """

    def __init__(self, actor: ReachActor) -> None:
        self._actor = actor

    def acts(self, batch: ReachBatch) -> Actions:
        """Return actions for every cell; see :class:`Controller`."""
        return _for_running(self, batch)

    def ask(self, batch: ReachBatch, rows: Rows, who: int | None) -> Actions:
        """Return actions of some cells; see :class:`Asked`."""
        _require_view(self._actor, batch)
        obs = batch.observe_goals(rows, batch.state.goal[rows][:, None], who)
        return self._actor.acts(obs[:, 0])


class Interpolated:
    """The policy between its training targets.

    Args:
        actor: A policy trained on a grid or a Halton set.

    Raises:
        InvalidInput: It was trained on a continuous set of goals.
    """

    def __init__(self, actor: ReachActor) -> None:
        self._between = Interpolation(actor)

    def acts(self, batch: ReachBatch) -> Actions:
        """Return actions for every cell; see :class:`Controller`.

        Raises:
            GoalOutside: A goal lies outside the targets.
        """
        return _for_running(self, batch)

    def ask(self, batch: ReachBatch, rows: Rows, who: int | None) -> Actions:
        """Return actions of some cells; see :class:`Asked`."""
        _require_view(self._between.actor, batch)
        mix, places = self._between.around(batch.state.goal[rows], "goals")
        return self._between.acts(batch.observe_goals(rows, places, who), mix)


class Averaged:
    """The mean over people of what is done beside each of them alone.

    With one person it is what is asked, exactly.

    Args:
        asked: What is done beside one person.
    """

    def __init__(self, asked: Asked) -> None:
        self._asked = asked

    def acts(self, batch: ReachBatch) -> Actions:
        """Return actions for every cell; see :class:`Controller`."""
        return _for_running(self, batch)

    def ask(self, batch: ReachBatch, rows: Rows, who: int | None) -> Actions:
        """Return actions of some cells; see :class:`Asked`."""
        if who is not None or batch.n_people < 2:
            return self._asked.ask(batch, rows, who)
        weights = person_weights(batch.person_distances(rows))
        mean = np.zeros((len(rows), 6))
        for person in range(batch.n_people):
            mean += weights[:, person, None] * self._asked.ask(batch, rows, person)
        return mean.astype(np.float32)


class Ahead:
    """What is asked, played ahead and changed where that ends in a contact.

    Args:
        mover: Who says what to do.
        actor: The policy it is played with.
        layer: The safety layer that it acts under.

    Raises:
        InvalidInput: The policy cannot be played ahead.
    """

    def __init__(self, mover: Controller, actor: ReachActor, layer: Layer = NO_LAYER) -> None:
        self._mover, self._ahead, self.layer = mover, Lookahead(actor), layer

    def acts(self, batch: ReachBatch) -> Actions:
        """Return actions for every cell; see :class:`Controller`."""
        act = self._mover.acts(batch)
        self._ahead.layer = self.layer
        self._ahead.improve(batch, act)
        return act


def person_weights(distances: Vec) -> Vec:
    """Return how much each person counts: the inverse square of the distance, as shares.

    Args:
        distances: Of robot and people [m], shape (n, n_people), at least one.

    Returns:
        Weights, which sum to one in every row, shape (n, n_people).
    """
    weight: Vec = np.maximum(distances, NEAREST_M) ** -POWER
    shares: Vec = weight / weight.sum(axis=1, keepdims=True)
    return shares


def controller_of(actor: ReachActor, how: How | None = None) -> Controller:
    """Return a way to move by a policy.

    Args:
        actor: The policy.
        how: The way; None interpolates where the policy has targets, else goes directly.

    Raises:
        InvalidInput: There is no such way, or there are no targets to interpolate between.
    """
    if how is None:
        how = "interpolated" if interpolates(actor) else "direct"
    if how not in HOWS:
        raise InvalidInput("how", how, "must name a way to move", HOWS)
    asked = Interpolated(actor) if "interpolated" in how else Direct(actor)
    mover = Averaged(asked) if "averaged" in how else asked
    return Ahead(mover, actor) if how.endswith(AHEAD) else mover


def inference_modes_of(actor: ReachActor) -> tuple[How, ...]:
    """Return the ways in which a policy can be asked."""
    between, ahead = interpolates(actor), looks_ahead(actor)
    return tuple(
        how
        for how in HOWS
        if (between or "interpolated" not in how) and (ahead or not how.endswith(AHEAD))
    )


def _for_running(asked: Asked, batch: ReachBatch) -> Actions:
    """Return what is asked where episodes go on, and 0 elsewhere, shape (n_envs, 6)."""
    act = np.zeros((batch.n_envs, 6), dtype=np.float32)
    rows = np.flatnonzero(batch.state.outcome == RUNNING)
    if rows.size:
        act[rows] = asked.ask(batch, rows, None)
    return act


def _require_view(actor: ReachActor, batch: ReachBatch) -> None:
    """Raise unless a batch observes what a policy was trained on.

    Raises:
        CheckpointMismatch: It observes something else.
    """
    if batch.settings.observation != actor.view:
        raise CheckpointMismatch("view", batch.settings.observation, actor.view)
