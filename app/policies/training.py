"""The one training path: from a preset and a seed to checkpoints.

Stable-Baselines3's ``learn`` drives; a callback counts on a fixed grid of environment steps,
reports progress, hands out checkpoints and listens for a stop. A run that is resumed refills
its replay memory with the policy it had before it updates again; those steps are not counted.
"""

import platform
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from importlib.metadata import version
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.type_aliases import TrainFreq, TrainFrequencyUnit

from app.errors import CheckpointMismatch, SimulationError
from app.policies import checkpoint as formats
from app.policies.checkpoint import Checkpoint
from app.policies.presets import Preset
from app.policies.td3 import PickTD3, twin_of
from app.policies.trained_cell import cell_of, manifest_fields
from app.policies.vecenv import PickVecEnv
from app.sim.cells import Cell, load_cell
from app.sim.kernels.arm import CONTROLLED
from app.sim.kernels.features import BODY_SIZES, SIZES
from app.sim.kernels.people import ABSENT
from app.sim.kernels.reward import RewardWeights
from app.sim.pick import PickBatch, PickSettings
from app.sim.scene import HumanKind
from app.sim.worker_motion import WorkSettings

LAYOUTS = {
    "features": [[name, size] for name, size in SIZES],
    "body": [[name, size] for name, size in BODY_SIZES],
}
"""Names and sizes of the groups of each kind of observation, as manifests carry them."""
REFILL_STEPS = 51_200
"""Environment steps that refill the replay memory after an interruption."""
RANGE_EVERY = 8
"""Vector steps between two looks at the range of the states."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Progress:
    """One point of the learning curve: the cells without exploration, since the last point."""

    step: int
    """Environment steps so far."""
    total_steps: int
    """Environment steps of the whole training."""
    updates: int
    """Updates of the critics so far."""
    episodes: int
    """Episodes that ended in the window, cells without exploration only."""
    success: float | None
    """Share of them that succeeded; None where none ended."""
    collision: float | None
    """Share of them that collided."""
    timeout: float | None
    """Share of them that ran out of time."""
    reward: float | None
    """Mean undiscounted return of them."""
    updates_per_s: float
    """Updates per second of wall time in the window."""
    steps_per_s: float
    """Environment steps per second of wall time in the window."""
    cpu_s: float
    """CPU time of the training so far, interrupted attempts up to their checkpoint included."""
    time_left_s: float
    """Estimated wall time to the end [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainResult:
    """How a training ended."""

    checkpoint: Checkpoint
    """The policy at the end."""
    step: int
    """Environment steps done."""
    stopped: bool
    """Whether it was asked to stop before its end."""


class _Ranges:
    """Least and greatest value of every state variable met in training."""

    def __init__(self, known: Mapping[str, Any] | None) -> None:
        known = known or {}
        self._low = {name: np.array(entry["low"]) for name, entry in known.items()}
        self._high = {name: np.array(entry["high"]) for name, entry in known.items()}

    def look(self, batch: PickBatch) -> None:
        state, people = batch.state, batch.state.people
        there = people.track != ABSENT
        met = {"q": state.q, "qd": state.qd, "goal": state.goal}
        if there.any():
            met |= {"human_q": people.q[there], "human_qd": people.qd[there]}
        for name, rows in met.items():
            low, high = rows.min(axis=0), rows.max(axis=0)
            self._low[name] = np.minimum(self._low.get(name, low), low)
            self._high[name] = np.maximum(self._high.get(name, high), high)

    def as_json(self) -> dict[str, dict[str, list[float]]]:
        return {
            name: {
                "low": [round(float(value), 5) for value in self._low[name]],
                "high": [round(float(value), 5) for value in self._high[name]],
            }
            for name in self._low
        }


def work_of(preset: Mapping[str, Any], seed: int = 0) -> WorkSettings:
    """Return what the workers do under a preset, as a manifest holds it.

    Args:
        preset: Fields of the preset; one from before task primitives has no ``human_motion``.
        seed: Seed of their postures and samples.
    """
    return WorkSettings(
        motion=preset.get("human_motion", "library"),
        seed=seed,
        pace=preset.get("human_pace", 1.0),
        courtesy=preset.get("human_courtesy", 0.0),
        roaming=preset.get("human_roaming", 0.0),
        absent=preset.get("human_absent", 0.0),
        augmentation=preset.get("augmentation", "sampled") == "sampled",
    )


def settings_of(preset: Preset) -> PickSettings:
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


class _Run:
    """One attempt at a training: model, counters and what goes into a checkpoint."""

    def __init__(
        self, preset: Preset, seed: int, resume: Checkpoint | None, cell: Cell
    ) -> None:
        self.preset, self.seed, self.cell = preset, seed, cell
        start = 0 if resume is None else int(resume.manifest["step"])
        batch = PickBatch(cell, preset.n_envs, seed + start, settings_of(preset))
        self.env = PickVecEnv(batch)
        self.model = PickTD3(preset, self.env, seed + start)
        self.cpu_before = 0.0
        self.ranges = _Ranges(resume.manifest["trained_range"] if resume else None)
        self.cpu_start = time.process_time()
        if resume is not None:
            self._restore(resume)

    @property
    def step(self) -> int:
        return int(self.model.num_timesteps)

    @property
    def cpu_s(self) -> float:
        return self.cpu_before + time.process_time() - self.cpu_start

    def _modules(self) -> dict[str, torch.nn.Module]:
        model = self.model
        return {
            "actor": model.actor.mu,
            "critic": twin_of(model.critic),
            "actor_target": model.actor_target.mu,
            "critic_target": twin_of(model.critic_target),
        }

    def _optimizers(self) -> dict[str, torch.optim.Optimizer]:
        return {
            "actor_adam": self.model.actor.optimizer,
            "critic_adam": self.model.critic.optimizer,
        }

    def checkpoints(self) -> tuple[Checkpoint, Checkpoint]:
        """Return the policy and what resuming needs."""
        arrays = {
            f"{name}.{key}": tensor.numpy()
            for name, module in self._modules().items()
            for key, tensor in module.state_dict().items()
        }
        manifest = self._manifest()
        chosen = {
            key: value
            for key, value in arrays.items()
            if key.split(".")[0] in ("actor", "critic")
        }
        policy = formats.pack({**manifest, "kind": "policy"}, chosen)
        for name, optimizer in self._optimizers().items():
            for index, moments in optimizer.state_dict()["state"].items():
                for key, tensor in moments.items():
                    arrays[f"{name}.{index}.{key}"] = tensor.numpy()
        return policy, formats.pack({**manifest, "kind": "resume"}, arrays)

    def _manifest(self) -> dict[str, Any]:
        return {
            "format": formats.FORMAT,
            "preset": asdict(self.preset),
            "seed": self.seed,
            **manifest_fields(self.cell),
            "layout": LAYOUTS[self.preset.observation],
            "act_size": CONTROLLED,
            "width": self.preset.width,
            "step": self.step,
            "updates": int(self.model._n_updates),
            "cpu_s": round(self.cpu_s, 1),
            "trained_range": self.ranges.as_json(),
            "versions": {
                "python": platform.python_version(),
                **{name: version(name) for name in ("torch", "stable-baselines3", "numba")},
            },
        }

    def _restore(self, resume: Checkpoint) -> None:
        if resume.manifest["kind"] != "resume":
            raise CheckpointMismatch("kind", "resume", resume.manifest["kind"])
        if resume.manifest["preset"] != asdict(self.preset):
            raise CheckpointMismatch("preset", asdict(self.preset), resume.manifest["preset"])
        if cell_of(resume.manifest) != self.cell:
            raise CheckpointMismatch("cell", self.cell.sha256, cell_of(resume.manifest).sha256)
        formats.expect_layout(resume, LAYOUTS[self.preset.observation], CONTROLLED)
        arrays = resume.arrays()
        for name, module in self._modules().items():
            module.load_state_dict(_under(arrays, name))
        for name, optimizer in self._optimizers().items():
            _restore_moments(optimizer, _under(arrays, name))
        self.model.num_timesteps = int(resume.manifest["step"])
        self.model._n_updates = int(resume.manifest["updates"])
        self.cpu_before = float(resume.manifest.get("cpu_s", 0.0))

    def refill(self) -> None:
        """Fill the replay memory with the restored policy; these steps are not counted."""
        model, step = self.model, self.step
        _, silent = model._setup_learn(self.preset.total_steps, None, False)
        n_steps = min(REFILL_STEPS, self.preset.buffer_size) // self.preset.n_envs
        assert model.replay_buffer is not None
        model.collect_rollouts(
            self.env,
            callback=silent,
            train_freq=TrainFreq(n_steps, TrainFrequencyUnit.STEP),
            replay_buffer=model.replay_buffer,
        )
        model.num_timesteps = step


def _under(arrays: Mapping[str, NDArray[Any]], prefix: str) -> dict[str, torch.Tensor]:
    """Return the tensors whose names start with ``prefix.``, without it."""
    start = f"{prefix}."
    return {
        key.removeprefix(start): torch.as_tensor(value)
        for key, value in arrays.items()
        if key.startswith(start)
    }


def _restore_moments(
    optimizer: torch.optim.Optimizer, tensors: Mapping[str, torch.Tensor]
) -> None:
    state: dict[int, dict[str, torch.Tensor]] = {}
    for key, tensor in tensors.items():
        index, moment = key.split(".", 1)
        state.setdefault(int(index), {})[moment] = tensor
    optimizer.load_state_dict({**optimizer.state_dict(), "state": state})


class _Reporter(BaseCallback):
    """Counts episodes and calls out on the grid of ``progress_steps``."""

    def __init__(
        self,
        run: _Run,
        on_progress: Callable[[Progress], None],
        on_checkpoint: Callable[[int, Checkpoint, Checkpoint], None],
        should_stop: Callable[[], bool],
    ) -> None:
        super().__init__()
        self.run, self.stopped = run, False
        self._on_progress, self._on_checkpoint = on_progress, on_checkpoint
        self._should_stop = should_stop
        self._returns = np.zeros(run.preset.n_envs)
        self._begin_window()

    def _begin_window(self) -> None:
        self._counts = np.zeros(4, dtype=np.int64)
        self._total_return = 0.0
        self._wall, self._window_step = time.monotonic(), self.run.step
        self._window_updates = int(self.run.model._n_updates)

    def _on_step(self) -> bool:
        self._count()
        step = self.num_timesteps
        if (step // self.run.preset.n_envs) % RANGE_EVERY == 0:
            self.run.ranges.look(self.run.env.batch)
        if step % self.run.preset.progress_steps == 0:
            self._on_progress(self._progress(step))
            self._begin_window()
            if step % self.run.preset.checkpoint_steps == 0:
                self._on_checkpoint(step, *self.run.checkpoints())
        self.stopped = self._should_stop()
        return not self.stopped

    def _count(self) -> None:
        n = self.run.model.exploration.n_greedy
        rewards = np.asarray(self.locals["rewards"])
        if not np.isfinite(rewards).all():
            raise SimulationError(
                f"non-finite reward at step {self.num_timesteps}, seed {self.run.seed}"
            )
        self._returns += rewards
        ended = self.run.env.ended
        finished = ended[:n] > 0
        self._counts += np.bincount(ended[:n][finished], minlength=4)
        self._total_return += float(self._returns[:n][finished].sum())
        self._returns[ended > 0] = 0.0

    def _progress(self, step: int) -> Progress:
        preset, wall = self.run.preset, max(1e-6, time.monotonic() - self._wall)
        episodes = int(self._counts.sum())
        rates = [None] * 4 if episodes == 0 else [c / episodes for c in self._counts.tolist()]
        speed = (step - self._window_step) / wall
        updates = int(self.run.model._n_updates)
        return Progress(
            step=step,
            total_steps=preset.total_steps,
            updates=updates,
            episodes=episodes,
            success=rates[1],
            collision=rates[2],
            timeout=rates[3],
            reward=self._total_return / episodes if episodes else None,
            updates_per_s=(updates - self._window_updates) / wall,
            steps_per_s=speed,
            cpu_s=self.run.cpu_s,
            time_left_s=(preset.total_steps - step) / speed,
        )


def train(
    preset: Preset,
    *,
    seed: int,
    resume: Checkpoint | None,
    on_progress: Callable[[Progress], None],
    on_checkpoint: Callable[[int, Checkpoint, Checkpoint], None],
    should_stop: Callable[[], bool],
    cell: Cell | None = None,
) -> TrainResult:
    """Train a preset, from the start or from where an attempt was interrupted.

    Args:
        preset: All hyper-parameters.
        seed: Seed of everything random.
        resume: The last ``resume`` checkpoint of an interrupted attempt.
        on_progress: Called every ``progress_steps``.
        on_checkpoint: Called every ``checkpoint_steps`` and at the end or stop with the step,
            the policy and what resuming needs.
        should_stop: Asked after every step of the cells, so it must be cheap.
        cell: The work cell that the preset names; by default the shipped one of that name.

    Raises:
        CheckpointMismatch: ``resume`` belongs to another preset, cell or program.
        InvalidInput: The cell cannot be trained in.
        SimulationError: A reward was not finite.
    """
    run = _Run(preset, seed, resume, cell or load_cell(preset.cell))
    if resume is not None:
        run.refill()
    reporter = _Reporter(run, on_progress, on_checkpoint, should_stop)
    left = preset.total_steps - run.step
    if left > 0:
        run.model.learn(left, callback=reporter, reset_num_timesteps=resume is None)
    policy, state = run.checkpoints()
    if run.step % preset.checkpoint_steps:
        on_checkpoint(run.step, policy, state)
    return TrainResult(checkpoint=policy, step=run.step, stopped=reporter.stopped)
