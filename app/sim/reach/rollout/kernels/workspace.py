"""Work space of the rollout policy improvement (compiled)."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.core.kernels import rng as random
from app.sim.prediction.kernels.networks import Floats, Network
from app.sim.reach.kernels.observation import N_FEATURES
from app.sim.reach.kernels.observation_workspace import ReachObservationWorkspace
from app.sim.reach.kernels.option_features import N_OPTION_FEATURES
from app.sim.reach.rollout.kernels.actor import CompiledActor, new_compiled_actor
from app.sim.reach.rollout.kernels.candidates import N_VIAS, POLICY, VIAS
from app.sim.reach.rollout.kernels.prediction import PredictedMotion, new_predicted_motion
from app.sim.robot.kernels.arm import Arm
from app.sim.scenario.kernels.person_observation import Obs

DISTANCE, HORIZON = range(2)
"""Entries of ``RolloutWorkspace.ssm``."""


class RolloutWorkspace(NamedTuple):
    """Policy, work space, and the plans of all environments; for one thread."""

    actor: CompiledActor
    """The policy."""
    observation: ReachObservationWorkspace
    """Observation of a simulated state."""
    people: PredictedMotion
    """Predicted people of the environment."""
    vias: Vec
    """Via configurations [rad], shape (N_VIAS, 6)."""
    q: Vec
    """Simulated joint positions [rad], shape (6,)."""
    qd: Vec
    """Joint speeds [rad/s], shape (6,)."""
    qdd: Vec
    """Joint accelerations [rad/s^2], shape (6,)."""
    c: Vec
    """Second coefficients of a control period [rad/s^2], shape (6,)."""
    d: Vec
    """Third coefficients of a control period [rad/s^3], shape (6,)."""
    obs: Obs
    """Observation of the policy, shape (n_obs,)."""
    act: Floats
    """Action of a step, shape (6,)."""
    first_act: Floats
    """First action of the candidate simulated last, shape (6,)."""
    best_act: Floats
    """The policy's action, then the first action of the best candidate, shape (6,)."""
    last_act: Floats
    """Actions of the previous decisions, shape (n_envs, 6)."""
    plan: NDArray[np.int64]
    """Candidate selected last, or POLICY, and the number of decisions since, (n_envs, 2)."""
    plan_waypoint: Vec
    """Waypoint of the candidate selected last, if sampled [rad], shape (n_envs, 6)."""
    plan_steps: NDArray[np.int64]
    """Duration of the motion to it [steps], shape (n_envs,)."""
    waypoint: Vec
    """Waypoint of the candidate that is simulated [rad], shape (6,)."""
    incumbent: Vec
    """Best sampled waypoint so far [rad], shape (n_envs, 6)."""
    incumbent_info: Vec
    """Its shortfall (least distance to the goal [m], or missing score under a speed and
    separation constraint; 0 for no incumbent), duration of the motion to it [steps], and time
    in the episode when it was stored [s], shape (n_envs, 3)."""
    n_sampled: NDArray[np.int64]
    """Decisions of the present episode that sampled waypoints, shape (n_envs,)."""
    closest: Vec
    """Least distance to the goal of the candidate simulated last [m], shape (1,)."""
    ssm: Vec
    """Speed and separation constraint: DISTANCE that people must keep from a moving robot [m]
    and HORIZON over which their motion counts [s]; zeros for none, shape (2,)."""
    ssm_distance: Vec
    """DISTANCE that applies in this decision [m], shape (1,); 0 where it does not apply."""
    q_goal: Vec
    """Configuration at the goal, under a constraint [rad], shape (6,)."""
    rng: random.State
    """Random stream of a decision, shape (1,)."""


def new_rollout_workspace(
    arm: Arm,
    net: Network,
    base_weight: float,
    observation: ReachObservationWorkspace,
    n_envs: int,
) -> RolloutWorkspace:
    """Return work space for a policy and ``n_envs`` environments.

    Args:
        net: The policy's network.
        base_weight: Weight of the base motion in its action.
    """
    vias = np.zeros((N_VIAS, 6))
    vias[:-1] = np.clip(arm.home + np.array(VIAS), arm.limits.q_min, arm.limits.q_max)

    def floats(*shape: int) -> Floats:
        return np.zeros(shape, dtype=np.float32)

    return RolloutWorkspace(
        actor=new_compiled_actor(net, base_weight),
        observation=observation,
        people=new_predicted_motion(),
        vias=vias,
        q=np.zeros(6),
        qd=np.zeros(6),
        qdd=np.zeros(6),
        c=np.zeros(6),
        d=np.zeros(6),
        obs=floats(N_FEATURES + N_OPTION_FEATURES),
        act=floats(6),
        first_act=floats(6),
        best_act=floats(6),
        last_act=floats(n_envs, 6),
        plan=np.full((n_envs, 2), POLICY),
        plan_waypoint=np.zeros((n_envs, 6)),
        plan_steps=np.zeros(n_envs, dtype=np.int64),
        waypoint=np.zeros(6),
        incumbent=np.zeros((n_envs, 6)),
        incumbent_info=np.zeros((n_envs, 3)),
        n_sampled=np.zeros(n_envs, dtype=np.int64),
        closest=np.zeros(1),
        ssm=np.zeros(2),
        ssm_distance=np.zeros(1),
        q_goal=np.zeros(6),
        rng=np.zeros(1, dtype=np.uint64),
    )
