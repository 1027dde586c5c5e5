"""Training on the pick scenario: settings, model, checkpoints and what its curve counts."""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.policies.algorithms.exploration import LadderNoise, OptionNoise
from app.policies.algorithms.td3 import BatchTD3, Networks, critics_of
from app.policies.algorithms.vecenv import CellVecEnv
from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.checkpoints.training_range import Ranges
from app.policies.configs.pick import PickPreset
from app.policies.networks.actor_critic import Critics, ResidualActor
from app.policies.training.progress import Progress
from app.policies.training.reporter import Reporter
from app.policies.training.run import Parts, TrainingRun
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.people.human_motion_config import HumanMotionConfig
from app.sim.people.kernels.people import ABSENT
from app.sim.pick.batch import OUTCOMES, PickBatch, PickSettings
from app.sim.pick.kernels.observation import BODY_SIZES, SIZES
from app.sim.pick.kernels.reward import RewardWeights
from app.sim.robot.kernels.arm import CONTROLLED
from app.sim.scene.scene import HumanKind

LAYOUTS = {
    "features": [[name, size] for name, size in SIZES],
    "body": [[name, size] for name, size in BODY_SIZES],
}
"""Names and sizes of the groups of each kind of observation, as manifests carry them."""
RANGE_EVERY = 8
"""Vector steps between two looks at the range of the states."""


def states_met(batch: PickBatch) -> dict[str, Vec]:
    """Return the states that all cells are in."""
    state, people = batch.state, batch.state.people
    there = people.track != ABSENT
    met = {"q": state.q, "qd": state.qd, "goal": state.goal}
    if there.any():
        met |= {"human_q": people.q[there], "human_qd": people.qd[there]}
    return met


def work_of(preset: Mapping[str, Any], seed: int = 0) -> HumanMotionConfig:
    """Return what the workers do under a preset, as a manifest holds it.

    Args:
        preset: Fields of the preset; one from before task primitives has no ``human_motion``.
        seed: Seed of their postures and samples.
    """
    return HumanMotionConfig(
        motion=preset.get("human_motion", "library"),
        seed=seed,
        pace=preset.get("human_pace", 1.0),
        yielding=preset.get("human_courtesy", 0.0),
        roaming=preset.get("human_roaming", 0.0),
        absent=preset.get("human_absent", 0.0),
        augmentation=preset.get("augmentation", "sampled") == "sampled",
    )


def settings_of(preset: PickPreset) -> PickSettings:
    """Return the scenario's settings of a preset."""
    worker: HumanKind = "worker"
    return PickSettings(
        time_limit_s=preset.time_limit_s,
        short_limit_s=preset.short_limit_s,
        short_share=preset.short_share,
        start_clearance_m=preset.start_clearance_m,
        target_jitter_m=preset.target_jitter_m,
        way_share=preset.way_share,
        people=None if preset.n_people == 1 else (worker,) * preset.n_people,
        work=work_of(asdict(preset)),
        observation="body" if preset.observation == "body" else "features",
        action=preset.action,
        weights=RewardWeights(
            c_d=preset.c_d,
            c_th=preset.c_th,
            c_c=preset.c_c,
            c_step=preset.c_step,
            c_v=preset.c_v,
            d_v=preset.d_v,
            c_s=preset.c_s,
            gamma=1.0,
        ),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Watched:
    """What the curve of a training on the pick scenario is counted from."""

    n_greedy: int
    """Cells without exploration, the first ones."""
    batch: PickBatch
    """All cells."""
    env: CellVecEnv
    """The same, as they are trained on."""
    ranges: Ranges
    """Range of the states."""


def start(
    preset: PickPreset,
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
    """
    first = 0 if resume is None else int(resume.manifest["step"])
    batch = PickBatch(cell, preset.n_envs, seed + first, settings_of(preset))
    env, rng = CellVecEnv(batch), np.random.default_rng(seed + first)
    noise = LadderNoise(
        batch.n_envs,
        CONTROLLED,
        batch.arm.dt,
        sigma_max=preset.sigma_max,
        time_s=preset.noise_time_s,
        greedy_share=preset.greedy_share,
        rng=rng,
    )
    model = BatchTD3(
        preset,
        env,
        seed + first,
        exploration=OptionNoise(noise, batch, batch.world.station_q, preset.option_rate, rng),
        networks=Networks(
            actor=lambda: ResidualActor(preset.width, batch.obs_size),
            critic=lambda: Critics(preset.width, batch.obs_size),
        ),
    )
    ranges = Ranges(resume.manifest["trained_range"] if resume else None)
    parts = Parts(
        policy={"actor": model.actor.mu, "critic": critics_of(model.critic)},
        targets={
            "actor_target": model.actor_target.mu,
            "critic_target": critics_of(model.critic_target),
        },
        optimizers={
            "actor_adam": model.actor.optimizer,
            "critic_adam": model.critic.optimizer,
        },
        layout=LAYOUTS[preset.observation],
        act_size=CONTROLLED,
        trained_range=ranges.as_json,
    )
    run = TrainingRun(preset, seed, cell, model, env, parts, resume)
    n_greedy = model.exploration.n_greedy
    return run, Watched(n_greedy=n_greedy, batch=batch, env=env, ranges=ranges)


class PickReporter(Reporter):
    """Counts the episodes of the cells without exploration.

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
        self._watched = watched
        self._returns = np.zeros(run.preset.n_envs)
        self._counts = np.zeros(len(OUTCOMES), dtype=np.int64)
        self._total_return = 0.0

    def watch(self, rewards: NDArray[np.floating]) -> None:
        """Count episodes that ended; look at the range of the states now and then."""
        n, ended = self._watched.n_greedy, self._watched.env.ended
        self._returns += rewards
        finished = ended[:n] > 0
        self._counts += np.bincount(ended[:n][finished], minlength=len(OUTCOMES))
        self._total_return += float(self._returns[:n][finished].sum())
        self._returns[ended > 0] = 0.0
        if (self.num_timesteps // len(rewards)) % RANGE_EVERY == 0:
            self._watched.ranges.look(states_met(self._watched.batch))

    def rates(self) -> dict[str, Any]:
        """Return how the episodes since the last point ended.

        An episode that ends *unfeasible* counts in ``episodes`` and has no share of its own.
        """
        episodes = int(self._counts.sum())
        shares = {
            name: int(self._counts[OUTCOMES.index(name)]) / episodes if episodes else None
            for name in ("success", "collision", "timeout")
        }
        reward = self._total_return / episodes if episodes else None
        self._counts[:], self._total_return = 0, 0.0
        return {"episodes": episodes, **shares, "reward": reward}
