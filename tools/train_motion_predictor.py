"""Make the shipped forecasts of walkers anew; run ``python -m tools.train_motion_predictor``.

Walkers of the cell ``CELL`` are started as in episodes and looked at at random moments: what a
row remembers goes in, how radius and way go on comes out. A tenth of them have constant
speed and radius, a tenth have been watched for a shorter time, and in a fifth what is
remembered is noisy, as from a tracker. The squared errors of two small networks are made small.

Takes about eight minutes on one core. The result is committed as ``forecasts_data/walker.npz``;
``tests/tools/test_train_motion_predictor.py`` trains for a moment and holds the shipped
networks to
errors on walkers they were not made from.
"""

import logging
import math
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from app.sim.cells.cell import load_cell
from app.sim.core.jit import kernel
from app.sim.core.kernels import rng as random
from app.sim.people.kernels.pedestrian import (
    AGE,
    GROWTH,
    N_PAST,
    PAST_RADIUS,
    PAST_SPEED,
    VX,
    VY,
    PedestrianRules,
    PedestrianState,
    R,
    advance_pedestrian,
    start_pedestrian,
)
from app.sim.people.pedestrian import pedestrian_rules, pedestrian_state
from app.sim.prediction.kernels.networks import (
    N_IN,
    N_TIMES,
    RADIUS_MIDDLE,
    RADIUS_SCALE,
    SPEED_MIDDLE,
    SPEED_SCALE,
    STEP_S,
    Network,
    see_past,
)
from app.sim.prediction.weights import write_networks
from app.sim.scene.scene import pedestrian_settings

logger = logging.getLogger(__name__)

CELL = "shared-workspace"
SEED = 6
WIDTH = 192
"""Units of each hidden layer."""
N_WALKERS = 1_000_000
"""Moments learned from."""
N_UPDATES = 40_000
BATCH = 1024
LR = 2e-3
MOST_PERIODS = 250
"""Latest moment looked at, in periods."""
DT = 0.02
"""Control period [s]."""
CONSTANT_SHARE, SHORT_SHARE, NOISY_SHARE = 0.1, 0.1, 0.2
MOST_NOISE = 0.02
"""Greatest standard deviation of noise on radii [m]; five times that on speeds [m/s]."""

AHEAD = STEP_S * np.arange(1, N_TIMES + 1)
"""Times of the forecasts [s]."""
TOLD = [2, 5, 8, 12, 17, 23, 31]
"""Which of them errors are told at."""

Floats = NDArray[np.float32]


@dataclass(frozen=True, slots=True, kw_only=True)
class Moments:
    """What was seen of walkers at some moment, and how they went on."""

    radius_seen: Floats
    """Inputs of the radius' network, (n, N_IN)."""
    way_seen: Floats
    """Inputs of the way's network, (n, N_IN)."""
    radius: Floats
    """What the first should say, (n, N_TIMES)."""
    way: Floats
    """What the second should say, (n, N_TIMES)."""


@kernel(nogil=True)
def _watch(
    rules: PedestrianRules,
    state: PedestrianState,
    kinds: NDArray[np.int64],
    periods: NDArray[np.int64],
    seed: int,
    stream: NDArray[np.uint64],
    radius_seen: Floats,
    way_seen: Floats,
    radius: Floats,
    way: Floats,
) -> None:
    rows = state.rows
    for n in range(kinds.shape[0]):
        p = kinds[n]
        random.start_stream(seed, n, 0, stream)
        start_pedestrian(rules, state, 0, p, stream)
        for _ in range(periods[n]):
            advance_pedestrian(rules, state, 0, p, DT)
        r, v = rows[0, p, R], math.hypot(rows[0, p, VX], rows[0, p, VY])
        see_past(
            r,
            rows[0, p, GROWTH],
            rows[0, p, AGE],
            rows[0, p, PAST_RADIUS : PAST_RADIUS + N_PAST],
            RADIUS_MIDDLE,
            RADIUS_SCALE,
            radius_seen[n],
        )
        see_past(
            v,
            0.0,
            rows[0, p, AGE],
            rows[0, p, PAST_SPEED : PAST_SPEED + N_PAST],
            SPEED_MIDDLE,
            SPEED_SCALE,
            way_seen[n],
        )
        done, gone = 0, 0.0
        for i in range(N_TIMES):
            while done < round(STEP_S * (i + 1) / DT):
                gone += DT * math.hypot(rows[0, p, VX], rows[0, p, VY])
                advance_pedestrian(rules, state, 0, p, DT)
                done += 1
            radius[n, i] = (rows[0, p, R] - r) / RADIUS_SCALE
            way[n, i] = (gone / (STEP_S * (i + 1)) - v) / SPEED_SCALE


def watched(n: int, seed: int) -> Moments:
    """Return walkers at random moments, exactly as they are.

    Args:
        n: How many.
        seed: Seed of who they are.
    """
    rng = np.random.default_rng(seed)
    person = pedestrian_settings(load_cell(CELL).cylinders[0])
    usual, constant = person, type(person)(kind="constant")
    rules, state = pedestrian_rules([usual, constant]), pedestrian_state(1, 2)
    kinds = (rng.random(n) < CONSTANT_SHARE).astype(np.int64)
    periods = rng.integers(1, MOST_PERIODS, n)
    seen = np.zeros((2, n, N_IN), dtype=np.float32)
    said = np.zeros((2, n, N_TIMES), dtype=np.float32)
    stream = np.zeros(1, dtype=np.uint64)
    _watch(rules, state, kinds, periods, seed, stream, seen[0], seen[1], said[0], said[1])
    return Moments(radius_seen=seen[0], way_seen=seen[1], radius=said[0], way=said[1])


def disturbed(
    seen: torch.Tensor, said: torch.Tensor, noise: float, rate_noise: float
) -> tuple[torch.Tensor, torch.Tensor]:
    """Return moments, some with a shorter past and some seen through noise.

    Args:
        seen: Inputs, (n, N_IN); left alone.
        said: What the network should say, (n, N_TIMES); left alone.
        noise: Greatest standard deviation of the values, in the network's units.
        rate_noise: That of the rate.
    """
    n, seen, said = len(seen), seen.clone(), said.clone()
    short = torch.rand(n) < SHORT_SHARE
    known = torch.randint(-1, N_PAST - 1, (n, 1))
    last = torch.where(known < 0, seen[:, :1], seen[:, 3:].gather(1, known.clamp(min=0)))
    beyond = (torch.arange(N_PAST)[None] > known) & short[:, None]
    seen[:, 3:] = torch.where(beyond, last, seen[:, 3:])
    strength = torch.rand(n, 1) * (torch.rand(n, 1) < NOISY_SHARE)
    now = noise * strength * torch.randn(n, 1)
    seen[:, :1] += now
    said -= now
    seen[:, 1:2] += rate_noise * strength * torch.randn(n, 1)
    seen[:, 3:] += noise * strength * torch.randn(n, N_PAST)
    return seen, said


def fitted(
    seen: Floats, said: Floats, noise: float, rate_noise: float, n_updates: int
) -> nn.Sequential:
    """Return a network that says ``said`` where it sees ``seen``.

    Args:
        seen: Inputs, (n, N_IN).
        said: Outputs, (n, N_TIMES).
        noise: As in :func:`disturbed`.
        rate_noise: See there.
        n_updates: Number of minibatches.
    """
    net = nn.Sequential(
        nn.Linear(N_IN, WIDTH),
        nn.ReLU(),
        nn.Linear(WIDTH, WIDTH),
        nn.ReLU(),
        nn.Linear(WIDTH, N_TIMES),
    )
    adam = torch.optim.Adam(net.parameters(), LR, fused=True)
    steps = torch.optim.lr_scheduler.CosineAnnealingLR(adam, n_updates)
    inputs, outputs = torch.as_tensor(seen), torch.as_tensor(said)
    for _ in range(n_updates):
        drawn = torch.randint(len(inputs), (BATCH,))
        x, y = disturbed(inputs[drawn], outputs[drawn], noise, rate_noise)
        loss = nn.functional.mse_loss(net(x), y)
        adam.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        adam.step()
        steps.step()
    return net


def network_of(net: nn.Sequential) -> Network:
    """Return a network as the kernels take it."""
    arrays: list[Floats] = []
    for layer in (net[0], net[2], net[4]):
        assert isinstance(layer, nn.Linear)
        arrays.append(np.ascontiguousarray(layer.weight.detach().numpy().T))
        arrays.append(layer.bias.detach().numpy().copy())
    return Network(*arrays)


def make(n_pedestrians: int, n_updates: int, seed: int) -> tuple[Network, Network]:
    """Return new networks for radius and way.

    Args:
        n_pedestrians: Moments learned from.
        n_updates: Minibatches for each.
        seed: Seed of everything random.
    """
    torch.manual_seed(seed)
    moments, rate = watched(n_pedestrians, seed), MOST_NOISE / 0.05
    radius = MOST_NOISE / RADIUS_SCALE, rate
    speed = 5.0 * MOST_NOISE / SPEED_SCALE, 0.0
    return (
        network_of(fitted(moments.radius_seen, moments.radius, *radius, n_updates)),
        network_of(fitted(moments.way_seen, moments.way, *speed, n_updates)),
    )


def errors(network: Network, seen: Floats, said: Floats) -> Floats:
    """Return the root mean square errors of a network at each time, (N_TIMES,)."""
    hidden = np.maximum(seen @ network.w1 + network.b1, 0.0)
    hidden = np.maximum(hidden @ network.w2 + network.b2, 0.0)
    off: Floats = hidden @ network.w3 + network.b3 - said
    return np.asarray(np.sqrt((off**2).mean(axis=0)), dtype=np.float32)


def going_on_as_now(moments: Moments) -> tuple[Floats, Floats]:
    """Return these errors of a steady growth within the limits, and of a steady speed."""
    middle, scale = np.float32(RADIUS_MIDDLE), np.float32(RADIUS_SCALE)
    now, growth = scale * moments.radius_seen[:, :1] + middle, moments.radius_seen[:, 1:2]
    settings = pedestrian_settings(load_cell(CELL).cylinders[0])
    grown = (
        np.clip(now + growth * AHEAD.astype(np.float32), settings.r_min, settings.r_max) - now
    )
    radius = np.sqrt(((grown / scale - moments.radius) ** 2).mean(axis=0))
    return np.asarray(radius), np.asarray(np.sqrt((moments.way**2).mean(axis=0)))


def main() -> None:
    """Train, tell errors on other walkers, and write."""
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    torch.set_num_threads(1)
    radius, way = make(N_WALKERS, N_UPDATES, SEED)
    other = watched(50_000, SEED + 1)
    kinds = (
        (
            "radius",
            np.full(N_TIMES, 1e3 * RADIUS_SCALE),
            errors(radius, other.radius_seen, other.radius),
        ),
        ("way", 1e3 * SPEED_SCALE * AHEAD, errors(way, other.way_seen, other.way)),
    )
    for (name, unit, off), plain in zip(kinds, going_on_as_now(other), strict=True):
        logger.info(
            "%s off by, root mean square [mm], at %s s: %s; going on as now: %s",
            name,
            AHEAD[TOLD].round(2),
            (unit * off)[TOLD].round(1),
            (unit * plain)[TOLD].round(1),
        )  # fmt: skip
    write_networks(radius, way)


if __name__ == "__main__":
    main()
