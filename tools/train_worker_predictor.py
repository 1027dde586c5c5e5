"""Train the shipped motion predictor of workers.

People of the trainings of ``pick-td3`` move beside a robot at rest; their present joints and
speeds are the input, their joints at the predicted times the target. The error of the hands is
reported for people with other postures, faster people and people with off-task motion, and
compared with that of constant speed.

Takes about two minutes on one core and writes ``app/sim/prediction/data/worker.npz``, which is
committed.
"""

import logging
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from torch import nn

from app.policies.configs.pick import PickPreset
from app.policies.networks.actor_critic import hidden
from app.policies.training.pick import settings_of
from app.sim.cells.cell import load_cell
from app.sim.core.arrays import Vec
from app.sim.human.kernels import kinematics as body
from app.sim.people.human_motion_config import HumanMotionConfig
from app.sim.pick.batch import PickBatch, PickSettings
from app.sim.prediction.kernels.worker import N_JOINTS, TIMES, WorkerPredictor, predict_worker
from app.sim.prediction.weights import WORKER_FILE, worker_predictor
from tools.arguments import parser_of
from tools.train_motion_predictor import network_of

logger = logging.getLogger(__name__)

SEED = 6
WIDTH = 128
"""Units of each hidden layer."""
N_PEOPLE, N_STEPS = 512, 600
"""People who are observed side by side, and for how long [control periods]."""
N_UPDATES, BATCH, LR = 15_000, 1024, 2e-3
HUBER = 0.2
"""Change of a joint from which its error counts linearly [m, rad]."""
LEAST_SCALE = 0.01
"""Added to the scale of each input [m, rad, per second]."""
OTHER_LIBRARY = 1_000_003
"""Seed of postures that do not occur in the training."""


class PostureMoments(NamedTuple):
    """Motion of people at n moments."""

    now: Vec
    """Joint positions and speeds [m, rad, per second], shape (n, 36)."""
    change: Vec
    """Change of the joints until each time [m, rad], shape (n, 3, 18)."""
    size: Vec
    """Body dimensions [m], shape (n, body.N_SIZE)."""


def watched(settings: PickSettings, n_people: int, n_steps: int, seed: int) -> PostureMoments:
    """Return the motion of people, observed at every control period."""
    batch = PickBatch(load_cell(PickPreset().cell), n_people, seed, settings)
    batch.reset()
    people, rest = batch.state.people, np.zeros((n_people, batch.n_act), dtype=np.float32)
    now = np.empty((n_steps, n_people, 2 * N_JOINTS))
    size = np.empty((n_steps, n_people, body.N_SIZE))
    episode = np.empty((n_steps, n_people), dtype=np.int64)
    for k in range(n_steps):
        now[k] = np.hstack([people.q[:, 0], people.qd[:, 0]])
        size[k], episode[k] = people.size[:, 0], batch.state.episode
        batch.step(rest, features=False)
    ahead = [round(t / batch.arm.dt) for t in TIMES]
    rows, who = np.nonzero(episode[: -ahead[-1]] == episode[ahead[-1] :])
    q = now[..., :N_JOINTS]
    change = np.stack([q[rows + k, who] - q[rows, who] for k in ahead], axis=1)
    return PostureMoments(now[rows, who], change, size[rows, who])


def fitted(moments: PostureMoments, n_updates: int, seed: int) -> WorkerPredictor:
    """Return a predictor trained on moments."""
    torch.manual_seed(seed)
    mean = moments.now.mean(axis=0)
    scale = moments.now.std(axis=0) + LEAST_SCALE
    net = nn.Sequential(
        *hidden(2 * N_JOINTS, WIDTH, 2), nn.Linear(WIDTH, len(TIMES) * N_JOINTS)
    )
    inputs = torch.as_tensor((moments.now - mean) / scale, dtype=torch.float32)
    targets = torch.as_tensor(moments.change.reshape(len(inputs), -1), dtype=torch.float32)
    adam = torch.optim.Adam(net.parameters(), LR, fused=True)
    rate = torch.optim.lr_scheduler.OneCycleLR(adam, LR, total_steps=n_updates)
    for _ in range(n_updates):
        drawn = torch.randint(len(inputs), (BATCH,))
        loss = nn.functional.smooth_l1_loss(net(inputs[drawn]), targets[drawn], beta=HUBER)
        adam.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        adam.step()
        rate.step()
    return worker_predictor(network_of(net), mean, scale)


def hands(q: Vec, size: Vec) -> Vec:
    """Return the positions of both hands [m], shape (n, 2, 3), at joints of shape (n, 18)."""
    trig, frames = np.zeros((3, 16)), np.zeros((body.N_FRAMES, 3, 3))
    points, out = np.zeros((body.N_POINTS, 3)), np.empty((len(q), 2, 3))
    for i in range(len(q)):
        body.points_and_frames(q[i], size[i], trig, points, frames)
        out[i] = points[body.HAND_R], points[body.HAND_L]
    return out


def hand_errors(predictor: WorkerPredictor, moments: PostureMoments) -> Vec:
    """Return mean errors of moving hands [m] at each time: of the predictor, at constant speed.

    A hand moves if it would be 5 cm away after 0.25 s.

    Returns:
        Errors, shape (2, 3).
    """
    q, qd = moments.now[:, :N_JOINTS], moments.now[:, N_JOINTS:]
    ahead = np.empty((len(q), len(TIMES), N_JOINTS))
    for i in range(len(q)):
        predict_worker(predictor, q[i], qd[i], ahead[i])
    here, tick = hands(q, moments.size), 1e-3
    speed = (hands(q + tick * qd, moments.size) - here) / tick
    moving = np.linalg.norm(speed, axis=2) > 0.05 / TIMES[0]
    errors = np.empty((2, len(TIMES)))
    for k, t in enumerate(TIMES):
        there = hands(q + moments.change[:, k], moments.size)
        for row, said in enumerate((hands(ahead[:, k], moments.size), here + t * speed)):
            errors[row, k] = np.linalg.norm(said - there, axis=2)[moving].mean()
    return errors


def training_people() -> PickSettings:
    """Return one person of the trainings, always present."""
    settings = settings_of(PickPreset())
    return replace(settings, people=("worker",), work=replace(settings.work, absent=0.0))


def other_people() -> dict[str, HumanMotionConfig]:
    """Return the people of the reported errors."""
    usual = HumanMotionConfig(seed=OTHER_LIBRARY)
    return {
        "library": usual,
        "faster": replace(usual, pace=1.4),
        "off-task": replace(usual, off_task=1.0),
    }


def write_worker_predictor(predictor: WorkerPredictor, file: Path = WORKER_FILE) -> None:
    """Write a predictor as the shipped file."""
    inputs = {"mean": predictor.mean, "scale": predictor.scale}
    arrays = predictor.network._asdict() | inputs
    np.savez(file, **{name: value.astype(np.float32) for name, value in arrays.items()})


def main() -> None:
    """Train, report errors on other people, and write the network."""
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    torch.set_num_threads(1)
    settings = training_people()
    predictor = fitted(watched(settings, N_PEOPLE, N_STEPS, SEED), N_UPDATES, SEED)
    for name, work in other_people().items():
        moments = watched(replace(settings, work=work), 64, 120, SEED + 1)
        ours, constant = 1e3 * hand_errors(predictor, moments)
        logger.info(
            "%s: error of moving hands [mm] at %s s: %s; at constant speed: %s",
            name,
            TIMES,
            ours.round(),
            constant.round(),
        )
    write_worker_predictor(predictor)


if __name__ == "__main__":
    parser_of(__doc__).parse_args()
    main()
