"""Motion decisions for ``bench decision-time``, beside eight calls of ``TD3.predict``.

``motion`` is one decision between training targets, eight states in one batch, as
``MotionDecider.decide`` gives it: checks, observations, network, weights, the segment and its
limits. ``motion-monitored`` adds speed and separation monitoring, ``motion-direct`` asks for
one state, ``motion-rollout`` plays the decision ahead. ``motion-sb3-predict`` is
Stable-Baselines3's own ``predict`` of a network of that size, called once for each of eight
observations that are ready: without observing, weighing and the segment.

All take turns, state by state, so that a machine that slows down slows all of them.
"""

import itertools
import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import gymnasium as gym
import numpy as np
from stable_baselines3 import TD3

from app.policies.checkpoints import pretrained
from app.policies.checkpoints.trained_cell import cell_of
from app.policies.inference.motion_decision import MotionDecider
from app.policies.inference.reach_policy import ReachPolicy
from app.sim.core.arrays import Vec
from app.sim.people.kernels.pedestrian import GROWTH, VX, VY, R, X, Y
from app.sim.perception.observed_people import person_from_cylinder
from app.sim.reach.batch import VIEWS, ReachBatch, ReachSettings
from app.sim.reach.motion_types import MotionQuery
from app.sim.safety.layer import SafetySettings
from tests.policies.untrained import untrained_reach

ALIAS = "reach"
STATES = 64
N_CORNERS = 8
WARM_UP = 50


def decider() -> tuple[MotionDecider, str]:
    """Return the shipped policy's decider, or one of the same size that has learned nothing."""
    shipped = ALIAS in pretrained.ALIASES
    checkpoint = pretrained.load(ALIAS) if shipped else untrained_reach()
    found = MotionDecider(ReachPolicy(checkpoint), cell_of(checkpoint.manifest))
    return found, "shipped" if shipped else "untrained, of the preset's size"


def queries(one: MotionDecider, seed: int) -> list[MotionQuery]:
    """Return states met while the robot moves at random, with goals between the targets."""
    settings = ReachSettings(people=("walker",), goals="box", observation=one.actor.view)
    batch = ReachBatch(one.cell, STATES, seed, settings)
    batch.reset()
    rng = np.random.default_rng(seed)
    for _ in range(40):
        batch.step(rng.uniform(-1.0, 1.0, (STATES, 6)).astype(np.float32), features=False)
    state, walkers = (
        batch.state,
        batch.state.people.walkers.rows[:, 0, [X, Y, VX, VY, R, GROWTH]],
    )
    return [
        MotionQuery(
            q=state.q[e].copy(),
            qd=state.qd[e].copy(),
            goal=state.goal[e].copy(),
            people=(person_from_cylinder(*walkers[e].tolist()),),
            safety=SafetySettings(),
            time_left_s=float(state.time_left[e]),
        )
        for e in range(STATES)
    ]


def requests(seed: int) -> list[dict[str, object]]:
    """Return the same states as requests of ``/v1/motion``, beside a person each."""
    found = []
    for one in queries(decider()[0], seed):
        (person,) = one.people
        assert person.cylinder is not None
        (x, y, r), (vx, vy) = person.cylinder.tolist(), person.qd[:2].tolist()
        found.append(
            {
                "cell": "shared-workspace",
                "robot": {"q": one.q.tolist(), "qd": one.qd.tolist()},
                "people": [{"x": x, "y": y, "vx": vx, "vy": vy, "r": r}],
                "goal": np.asarray(one.goal).tolist(),
                "time_left_s": one.time_left_s,
            }
        )
    return found


def predicting(one: MotionDecider, seed: int) -> Callable[[], None]:
    """Return eight calls of ``TD3.predict`` on a network of the same size."""
    n_obs = VIEWS[one.actor.view][1]
    model = TD3("MlpPolicy", _Spaces(n_obs), policy_kwargs={"net_arch": [256, 256]}, seed=seed)
    obs = np.random.default_rng(seed).normal(size=(N_CORNERS, n_obs)).astype(np.float32)

    def call() -> None:
        for row in obs:
            model.predict(row, deterministic=True)

    return call


class _Spaces(gym.Env[np.ndarray, np.ndarray]):
    """Says how long observations and actions are; nothing is ever stepped."""

    def __init__(self, n_obs: int) -> None:
        self.observation_space = gym.spaces.Box(-100.0, 100.0, (n_obs,), np.float32)
        self.action_space = gym.spaces.Box(-1.0, 1.0, (6,), np.float32)


def motion_times(seed: int, seconds: float) -> tuple[dict[str, Vec], str]:
    """Return the times of each kind of call [ms], by name, and which policy decided."""
    one, policy = decider()
    turn = itertools.cycle(queries(one, seed))
    predict = predicting(one, seed)

    def asked(query: MotionQuery) -> Sequence[tuple[str, Callable[[], object]]]:
        query = replace(query, rollout=False)
        alone = replace(query, safety=None)
        direct, ahead = replace(alone, inference_mode="direct"), replace(alone, rollout=True)
        return (
            ("motion", lambda: one.decide(alone)),
            ("motion-monitored", lambda: one.decide(query)),
            ("motion-direct", lambda: one.decide(direct)),
            ("motion-rollout", lambda: one.decide(ahead)),
            ("motion-sb3-predict", predict),
        )

    apart = (q for q in turn if one.decide(q).clearance[0] > 0.0)
    for _ in range(WARM_UP):
        for _, call in asked(next(apart)):
            call()
    times: dict[str, list[float]] = {}
    ends = time.perf_counter() + seconds
    while time.perf_counter() < ends:
        for name, call in asked(next(apart)):
            begin = time.perf_counter()
            call()
            times.setdefault(name, []).append(1e3 * (time.perf_counter() - begin))
    return {name: np.array(found) for name, found in times.items()}, policy
