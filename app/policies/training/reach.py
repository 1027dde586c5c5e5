"""Training on the reach scenario: settings, model, checkpoints and what its curve counts.

A point of the curve is played for it alone: greedy episodes from the preset's own starts, the
same ones at every point. The CPU time that takes is not counted as training.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from app.policies.algorithms.exploration import Explorer, LadderNoise, OptionNoise, OUNoise
from app.policies.algorithms.quantiles import QuantileCritics
from app.policies.algorithms.td3 import BatchTD3, Extras, Networks, critics_of
from app.policies.algorithms.vecenv import CellVecEnv, Foresight
from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.checkpoints.training_range import Ranges
from app.policies.configs.reach import ReachPreset
from app.policies.inference.reach_policy import CROWD, LAYOUTS
from app.policies.networks.actor_critic import Critics, PlainActor, ResidualActor
from app.policies.training.progress import Progress
from app.policies.training.reporter import Reporter
from app.policies.training.run import Parts, TrainingRun
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.people.kernels.pedestrian import VX, VY, R, X, Y
from app.sim.pick.batch import OUTCOMES
from app.sim.reach.batch import N_ACT, ReachBatch, ReachSettings
from app.sim.reach.kernels.observation import BASE_START
from app.sim.reach.kernels.reward import ReachWeights
from app.sim.reach.mixed_batch import ReachMix, ReachRows
from app.sim.reach.monitored.batch import GuardedReach
from app.sim.robot.kernels.kinematics import ik_vertical_batch
from app.sim.safety.layer import safety_settings
from app.sim.scene.scene import HumanKind

CURVE_SEED = 1_000_003
"""Seed of the episodes behind a point of the curve; no evaluation uses it."""
RANGE_EVERY = 8
"""Vector steps between two looks at the range of the states."""


def settings_of(preset: ReachPreset) -> ReachSettings:
    """Return the scenario's settings of a preset."""
    walker: HumanKind = "walker"
    return ReachSettings(
        time_limit_s=preset.time_limit_s,
        goals=preset.goals,  # type: ignore[arg-type]
        n_halton=preset.n_halton,
        people=(walker,) * preset.n_people,
        start=preset.start,  # type: ignore[arg-type]
        start_clearance_m=preset.start_clearance_m,
        collision_ends=preset.collision == "ends",
        action=preset.action,
        observation=preset.observation,  # type: ignore[arg-type]
        weights=ReachWeights(
            c_d=preset.c_d,
            c_p=preset.c_p,
            gamma=1.0,
            c_a=preset.c_a,
            c_step=preset.c_step,
            c_c=preset.c_c,
            c_s=preset.c_s,
            c_o=preset.c_o,
        ),
    )


def batch_of(preset: ReachPreset, cell: Cell, n_envs: int, seed: int) -> ReachRows:
    """Return the cells that a preset trains in, or that its curve is played in."""
    settings = settings_of(preset)
    if preset.safety == "ssm":
        return GuardedReach(cell, n_envs, seed, settings, safety_settings(cell))
    if preset.people == "up-to":
        return ReachMix(cell, n_envs, seed, settings)
    return ReachBatch(cell, n_envs, seed, settings)


def explorer_of(preset: ReachPreset, batch: ReachRows, seed: int) -> Explorer:
    """Return what changes actions so that other ones are tried."""
    rng = np.random.default_rng(seed)
    if preset.noise == "ou":
        return OUNoise(batch.n_envs, N_ACT, preset.ou_theta, preset.ou_sigma, rng)
    ladder = LadderNoise(
        batch.n_envs,
        N_ACT,
        batch.arm.dt,
        sigma_max=preset.sigma_max,
        time_s=preset.noise_time_s,
        greedy_share=preset.greedy_share,
        rng=rng,
    )
    if preset.option_rate == 0.0:
        return ladder
    assert isinstance(batch, ReachBatch)
    arm, targets = batch.arm, batch.world.targets
    postures, _ = ik_vertical_batch(arm.lengths, arm.limits, targets)
    return OptionNoise(ladder, batch, postures, preset.option_rate, rng)


def networks_of(preset: ReachPreset, n_obs: int, n_critic: int) -> Networks:
    """Return what makes an actor that sees ``n_obs`` numbers and critics that see more."""
    width, layers, normed = preset.width, preset.layers, preset.critic_norm == "layer"
    crowd = CROWD if preset.observation == "crowd" else None

    def actor() -> ResidualActor | PlainActor:
        if preset.actor == "residual":
            return ResidualActor(width, n_obs, N_ACT, BASE_START, layers, crowd)
        return PlainActor(width, n_obs, N_ACT, layers, crowd)

    def critic() -> Critics:
        n = preset.n_critics
        if preset.critic == "mean":
            return Critics(width, n_critic, N_ACT, n, layers, normed, crowd=crowd)
        quantiles = preset.n_quantiles, preset.dropped_quantiles
        return QuantileCritics(width, n_critic, N_ACT, n, layers, normed, *quantiles, crowd)

    return Networks(actor=actor, critic=critic, fused=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class Watched:
    """What the curve of a training on the reach scenario is counted from."""

    batch: ReachRows
    """All cells."""
    actor: torch.nn.Module
    """The policy."""
    ranges: Ranges
    """Range of the states."""


def start(
    preset: ReachPreset,
    seed: int,
    resume: Checkpoint | None,
    cell: Cell,
) -> tuple[TrainingRun, Watched]:
    """Return a run of the preset, from the start or from a checkpoint, and what it counts.

    Args:
        preset: All hyper-parameters.
        seed: Seed of everything random.
        resume: The last ``resume`` checkpoint of an interrupted attempt.
        cell: Work cell trained in.

    Raises:
        InvalidInput: The cell has no goal region.
    """
    first = 0 if resume is None else int(resume.manifest["step"])
    batch = batch_of(preset, cell, preset.n_envs, seed + first)
    foresight = None
    if preset.critic_sees == "future":
        assert isinstance(batch, ReachBatch)
        foresight = Foresight(batch)
    env = CellVecEnv(batch, preset.observation != "state", foresight)
    model = BatchTD3(
        preset,
        env,
        seed + first,
        exploration=explorer_of(preset, batch, seed + first),
        networks=networks_of(preset, batch.obs_size, env.n_seen),
        extras=Extras(
            update_every=preset.update_every,
            actor_lr_ratio=preset.actor_lr_ratio,
            alpha=preset.alpha,
            beta=preset.beta,
            ema=preset.ema,
            bfloat16=preset.precision == "bfloat16",
        ),
    )
    ranges = Ranges(resume.manifest["trained_range"] if resume else None)
    parts = Parts(
        policy={"actor": model.decider, "critic": critics_of(model.critic)},
        targets={
            "actor_target": model.actor_target.mu,
            "critic_target": critics_of(model.critic_target),
            **({} if model.averaged is None else {"actor_learned": model.actor.mu}),
        },
        optimizers={
            "actor_adam": model.actor.optimizer,
            "critic_adam": model.critic.optimizer,
        },
        layout=LAYOUTS[preset.observation],
        act_size=N_ACT,
        trained_range=ranges.as_json,
    )
    run = TrainingRun(preset, seed, cell, model, env, parts, resume)
    return run, Watched(batch=batch, actor=model.decider, ranges=ranges)


class ReachReporter(Reporter):
    """Plays the episodes behind the curve.

    Args:
        run: The attempt.
        on_progress: Takes the points of the curve.
        on_checkpoint: Takes the step, the policy and what resuming needs.
        should_stop: Asked after every step.
        watched: What is counted.
    """

    def __init__(
        self,
        run: TrainingRun,
        on_progress: Callable[[Progress], None],
        on_checkpoint: Callable[[int, Checkpoint, Checkpoint], None],
        should_stop: Callable[[], bool],
        watched: Watched,
    ) -> None:
        super().__init__(run, on_progress, on_checkpoint, should_stop)
        self._run, self._watched, preset = run, watched, run.preset
        assert isinstance(preset, ReachPreset)
        n = preset.progress_episodes
        self._played = batch_of(preset, run.cell, n, CURVE_SEED)

    def watch(self, rewards: NDArray[np.floating]) -> None:
        """Look at the range of the states now and then."""
        if (self.num_timesteps // len(rewards)) % RANGE_EVERY == 0:
            self._watched.ranges.look(states_met(self._watched.batch))

    def rates(self) -> dict[str, Any]:
        """Return how greedy episodes end now."""
        began = time.process_time()
        ended, returns = play(self._watched.actor, self._played)
        self._run.leave_out(time.process_time() - began)
        shares = {name: float((ended == k).mean()) for k, name in enumerate(OUTCOMES)}
        return {
            "episodes": len(ended),
            **{name: shares[name] for name in ("success", "collision", "timeout")},
            "reward": float(returns.mean()),
        }


def states_met(batch: ReachRows) -> dict[str, Vec]:
    """Return the states that all cells are in."""
    parts = batch.parts if isinstance(batch, ReachMix) else (batch,)
    states = [part.state for part in parts]
    met = {
        "q": np.concatenate([state.q for state in states]),
        "qd": np.concatenate([state.qd for state in states]),
        "goal": np.concatenate([state.goal for state in states]),
    }
    seen = [X, Y, VX, VY, R]
    walkers = [state.people.walkers.rows[:, :, seen].reshape(-1, 5) for state in states]
    if sum(len(rows) for rows in walkers):
        met["human"] = np.concatenate(walkers)
    return met


def play(
    actor: torch.nn.Module, batch: ReachRows
) -> tuple[NDArray[np.int64], NDArray[np.floating]]:
    """Play one greedy episode in every row of a batch.

    Returns:
        Outcomes and undiscounted returns, each (n_envs,).
    """
    obs = batch.reset().copy()
    ended, returns = np.zeros(batch.n_envs, dtype=np.int64), np.zeros(batch.n_envs)
    act = np.zeros((batch.n_envs, N_ACT), dtype=np.float32)
    while (live := np.flatnonzero(ended == 0)).size:
        with torch.inference_mode():
            act[live] = actor(torch.as_tensor(obs[live])).numpy()
        result = batch.step(act, auto_reset=False)
        obs, returns = result.obs.copy(), returns + result.rew
        ended = np.where(result.ended > 0, result.ended, ended)
    return ended, returns
