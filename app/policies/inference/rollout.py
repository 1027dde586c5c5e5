"""Rollout policy improvement of a trained reach policy.

``app/sim/reach/rollout/kernels/improvement.py`` simulates the candidates; this module applies
it to a policy and a batch of environments, or to one queried state.
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
from app.sim.reach.kernels.episode import ReachCell
from app.sim.reach.kernels.observation_workspace import new_observation_workspace
from app.sim.reach.reach_actor import ReachActor
from app.sim.reach.rollout.kernels import candidates
from app.sim.reach.rollout.kernels import improvement as kernel
from app.sim.reach.rollout.kernels.workspace import RolloutWorkspace, new_rollout_workspace
from app.sim.safety.layer import SafetySettings
from app.sim.scenario.kernels.episode import EpisodeState

POLICY = candidates.POLICY
"""Index in place of a candidate's: the policy's own action."""
_LETTERS = {1.0: "f", -1.0: "b", 0.0: "h"}
CANDIDATES = (
    *(
        f"{name}-{n * STEP_S:.2g}s"
        for name in candidates.VIA_NAMES
        for n in candidates.VIA_STEPS
    ),
    "straight",
    *(
        f"bang-bang-{''.join(_LETTERS[sign] for sign in signs)}-{n * STEP_S:.2g}s"
        for signs in candidates.SIGNS
        for n in candidates.EVASION_STEPS
    ),
    "sampled",
)
"""Names of the candidates: via configuration or directions of pan, shoulder and elbow (forward,
back, held), and duration of the first part."""

Actions = NDArray[np.float32]


class SsmConstraint(NamedTuple):
    """Separation of moving robot and people that keeps the safety layer from stopping."""

    distance: float
    """Distance that people must keep from a moving robot [m]; 0 for no constraint."""
    horizon: float
    """Time until a motion that is commanded now has ended [s]."""


NO_CONSTRAINT = SsmConstraint(0.0, 0.0)
"""No layer, or one in worst-case mode, in which the predicted motion of people does not
determine where the layer stops the robot."""
SPARE_DISTANCE = 0.04
"""Distance added for the stopping of a moving robot [m]. With 0.02 m instead, the time to goal
fell from 4.29 to 4.20 s and the share of runs without a stop from 60 to 43 % (first 100
crossings of seed 77)."""
LONGEST_HORIZON = 1.0
"""Largest horizon of a constraint [s]."""


def ssm_constraint_of(
    settings: SafetySettings | None, dt: float, age: float = 0.0
) -> SsmConstraint:
    """Return the constraint of a safety layer.

    Args:
        settings: Assumptions of the layer; None for no layer.
        dt: Control period [s].
        age: Age of the observation of people beyond the tracker's delay [s].
    """
    if settings is None or not settings.use_measured_velocity:
        return NO_CONSTRAINT
    horizon = min(LONGEST_HORIZON, settings.latency + dt + age)
    distance = settings.margin + settings.speed_change * horizon + SPARE_DISTANCE
    return SsmConstraint(distance, horizon)


def _network_of(actor: ReachActor) -> Network | None:
    """Return the network that rollouts simulate; None if they cannot.

    Rollouts move the robot by whole control periods and people by ``STEP_S``.
    """
    if not isinstance(actor, ReachPolicy):
        return None
    periods = STEP_S / actor.dt
    return actor.kernel_network if abs(periods - round(periods)) < 1e-9 else None


def can_roll_out(actor: ReachActor) -> bool:
    """Return whether a policy can be simulated.

    It is a residual actor of two layers with option features, and its control period divides
    ``STEP_S``.
    """
    return _network_of(actor) is not None


class ReachEnvs(Protocol):
    """Environments of the reach scenario: a batch, or one queried state."""

    @property
    def world(self) -> ReachCell: ...  # noqa: D102
    @property
    def state(self) -> EpisodeState: ...  # noqa: D102


class RolloutImprovement:
    """Improves the actions of one policy; used by one thread at a time.

    Raises:
        InvalidInput: The policy cannot be simulated.
    """

    def __init__(self, actor: ReachActor) -> None:
        network = _network_of(actor)
        if network is None or not isinstance(actor, ReachPolicy):
            rule = (
                "must be a residual actor of two layers with option features, in a cell whose "
                f"control period dt divides {STEP_S} s, for rollouts"
            )
            raise InvalidInput("checkpoint", actor.checkpoint, rule)
        self._network, self._rule, self._dt = network, actor.action.rule(), actor.dt
        self.constraint = NO_CONSTRAINT
        """Constraint of the safety layer."""
        self._envs: ReachEnvs | None = None
        self._work: RolloutWorkspace | None = None
        self._call: Callable[..., None] = kernel.improve_batch

    def forget(self) -> None:
        """Clear the plans, so that the next decision is independent of the previous ones."""
        if self._work is not None:
            self._work.plan[:], self._work.n_sampled[:] = POLICY, 0
            self._work.incumbent_info[:] = 0.0

    def improve(self, envs: ReachEnvs, act: Actions) -> NDArray[np.int64]:
        """Replace actions whose rollout collides by the first actions of better candidates.

        Args:
            envs: The environments; those whose episode has ended are skipped.
            act: The policy's actions, shape (n_envs, 6); changed.

        Returns:
            Index of the selected candidate in ``CANDIDATES``, or POLICY, shape (n_envs,).

        Raises:
            InvalidInput: The environments have another control period than the policy.
        """
        world, state, chosen = envs.world, envs.state, np.empty(len(act), dtype=np.int64)
        if self._work is None or self._envs is not envs:
            if world.arm.dt != self._dt:
                rule = f"must be {self._dt:g} s, the policy's control period, for rollouts"
                raise InvalidInput("robot.dt", world.arm.dt, rule)
            workspace = new_observation_workspace(
                world.arm, world.people, state.people, new_motion_predictor()
            )
            self._envs, self._work = (
                envs,
                new_rollout_workspace(
                    world.arm, self._network, BASE_WEIGHT, workspace, len(act)
                ),
            )
            arguments = world, self._rule, state, act, self._work, chosen
            self._call = direct(kernel.improve_batch, arguments)
        self._work.ssm[:] = self.constraint
        self._call(world, self._rule, state, act, self._work, chosen)
        return chosen
