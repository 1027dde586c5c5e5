"""Looking ahead with a policy: its actions, replaced where they would end in a contact.

``app/sim/reach/rollout/kernels/improvement.py`` plays them forward; here it meets a policy and
a batch.
"""

from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from app.errors import InvalidInput
from app.policies.inference.reach_policy import ReachPolicy
from app.policies.networks.actor_critic import BASE_WEIGHT
from app.sim.core.jit import direct
from app.sim.prediction.kernels.networks import STEP_S, Network
from app.sim.prediction.weights import new_motion_predictor
from app.sim.reach.kernels.episode import ReachState, ReachWorld, Work, new_work
from app.sim.reach.reach_actor import ReachActor
from app.sim.reach.rollout.kernels import candidates as other_ways
from app.sim.reach.rollout.kernels import improvement as kernel
from app.sim.reach.rollout.kernels import rollout as played_ways
from app.sim.safety.layer import SafetySettings

PASSED = other_ways.PASSED
"""In place of the number of another way: the action passed as it is."""
_LETTERS = {1.0: "f", -1.0: "b", 0.0: "h"}
OTHERS = (
    *(f"{name}-{n * STEP_S:.2g}s" for name in other_ways.NAMES for n in other_ways.LASTING),
    "straight",
    *(
        f"dash-{''.join(_LETTERS[sign] for sign in signs)}-{n * STEP_S:.2g}s"
        for signs in other_ways.SIGNS
        for n in other_ways.DASHING
    ),
    "dart",
)
"""Names of the other ways: where they lead first, and for how long. Of a dash, what pan,
shoulder and elbow do: forward, back, or held. Where a dart leads is drawn."""

Actions = NDArray[np.float32]


class Layer(NamedTuple):
    """What looking ahead knows of a safety layer."""

    distance: float
    """How far people are kept from a robot that moves [m]; 0 where nothing is known."""
    ahead: float
    """How long they go on until a motion that is asked for now is over [s]."""


NO_CONSTRAINT = Layer(0.0, 0.0)
"""No layer, or one that takes people to come at once from wherever they are: nothing that is
known of their way says where it would not hold the robot."""


SPARE_DISTANCE = 0.04
"""People are kept so much farther away than a robot at rest is asked to [m]: one that moves
must be able to stop. With 0.02 m the time to the goal fell from 4.29 to 4.20 s, and the share
of runs never stopped from 60 to 43 %, on the first 100 crossings of seed 77."""
LONGEST_HORIZON = 1.0
"""Longest time ahead for which people's way counts [s]."""


def ssm_constraint_of(settings: SafetySettings | None, dt: float, age: float = 0.0) -> Layer:
    """Return what looking ahead knows of a safety layer.

    Args:
        settings: What it assumes; None where there is none.
        dt: Control period [s].
        age: How old people are beyond the tracker's delay [s].
    """
    if settings is None or not settings.use_measured_velocity:
        return NO_CONSTRAINT
    ahead = min(LONGEST_HORIZON, settings.latency + dt + age)
    return Layer(settings.margin + settings.speed_change * ahead + SPARE_DISTANCE, ahead)


def _network_of(actor: ReachActor) -> Network | None:
    return actor.kernel_network if isinstance(actor, ReachPolicy) else None


def can_roll_out(actor: ReachActor) -> bool:
    """Whether a policy can be played ahead: one of ours that sees forecasts."""
    return _network_of(actor) is not None


class Cells(Protocol):
    """Rows of the reach scenario: a batch, or a stage that somebody's state was put into."""

    @property
    def world(self) -> ReachWorld: ...  # noqa: D102
    @property
    def state(self) -> ReachState: ...  # noqa: D102


class Lookahead:
    """Plays the actions of one policy ahead; used by one thread at a time.

    Args:
        actor: The policy.

    Raises:
        InvalidInput: It cannot be played ahead.
    """

    def __init__(self, actor: ReachActor) -> None:
        network = _network_of(actor)
        if network is None:
            rule = "must be a residual actor of two layers that sees forecasts, to look ahead"
            raise InvalidInput("checkpoint", actor.checkpoint, rule)
        self._network, self._rule = network, actor.action.rule()
        self.layer = NO_CONSTRAINT
        """The safety layer that what is played goes through."""
        self._cells: Cells | None = None
        self._work: tuple[Work, played_ways.Lookahead] | None = None
        self._call: Callable[..., None] = kernel.look_ahead_batch

    def forget(self) -> None:
        """Forget what was begun before: the next decision stands for itself."""
        if self._work is None:
            return
        look = self._work[1]
        look.plan[:], look.drawn[:], look.nearest[:] = PASSED, 0, 0.0

    def improve(self, cells: Cells, act: Actions) -> NDArray[np.int64]:
        """Replace actions that end in a contact by the first ones of better ways.

        Args:
            cells: Where they are asked for; rows whose episode has ended are left out.
            act: The policy's actions, shape (n_envs, 6); changed.

        Returns:
            Numbers of the ways begun instead, among ``OTHERS``, or PASSED, shape (n_envs,).
        """
        world, state, chosen = cells.world, cells.state, np.empty(len(act), dtype=np.int64)
        if self._work is None or self._cells is not cells:
            look = played_ways.new_lookahead(world.arm, self._network, BASE_WEIGHT, len(act))
            self._cells, self._work = (
                cells,
                (new_work(world, state, new_motion_predictor()), look),
            )
            self._call = direct(
                kernel.look_ahead_batch, (world, self._rule, state, act, *self._work, chosen)
            )
        self._work[1].layer[:] = self.layer
        self._call(world, self._rule, state, act, *self._work, chosen)
        return chosen
