"""Train the shipped motion predictor of pedestrians.

Pedestrians of the cell ``CELL`` start as in episodes and are sampled at random moments: the
remembered motion is the input, the later motion the target. A tenth of them have constant speed
and radius, a tenth a shorter past, and a fifth a past with noise as of a tracker. The two
networks are trained on the mean squared error.

Takes about eight minutes on one core and writes ``app/sim/prediction/data/walker.npz``, which
is committed. A test trains briefly and checks the errors of the shipped networks on other
pedestrians.
"""

import logging
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from app.policies.networks.actor_critic import hidden
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
    write_predictor_input,
)
from app.sim.prediction.weights import FILE, KINDS
from app.sim.scene.scene import pedestrian_settings
from tools.arguments import parser_of

logger = logging.getLogger(__name__)

CELL = "shared-workspace"
SEED = 6
WIDTH = 192
"""Units of each hidden layer."""
N_WALKERS = 1_000_000
"""Moments to train on."""
N_UPDATES = 40_000
BATCH = 1024
LR = 2e-3
MOST_PERIODS = 250
"""Latest moment [control periods]."""
DT = 0.02
"""Control period [s]."""
CONSTANT_SHARE, SHORT_SHARE, NOISY_SHARE = 0.1, 0.1, 0.2
MOST_NOISE = 0.02
"""Largest standard deviation of the noise of radii [m]; five times that for speeds [m/s]."""

AHEAD = STEP_S * np.arange(1, N_TIMES + 1)
"""Times of the predictions [s]."""
REPORTED = [2, 5, 8, 12, 17, 23, 31]
"""Indices of the times at which errors are reported."""

Floats = NDArray[np.float32]


class Moments(NamedTuple):
    """Inputs and targets of the networks at n moments."""

    radius_seen: Floats
    """Inputs of the radius network, (n, N_IN)."""
    path_seen: Floats
    """Inputs of the path network, (n, N_IN)."""
    radius: Floats
    """Targets of the radius network, (n, N_TIMES)."""
    path: Floats
    """Targets of the path network, (n, N_TIMES)."""


@kernel(nogil=True)
def _watch(
    rules: PedestrianRules,
    state: PedestrianState,
    kinds: NDArray[np.int64],
    periods: NDArray[np.int64],
    seed: int,
    stream: NDArray[np.uint64],
    out: Moments,
) -> None:
    """Fill ``out`` with pedestrians of given kinds after given numbers of control periods."""
    rows = state.rows
    for n in range(kinds.shape[0]):
        p = kinds[n]
        random.start_stream(seed, n, 0, stream)
        start_pedestrian(rules, state, 0, p, stream)
        for _ in range(periods[n]):
            advance_pedestrian(rules, state, 0, p, DT)
        row = rows[0, p]
        r, v, age = row[R], math.hypot(row[VX], row[VY]), row[AGE]
        radii = row[PAST_RADIUS : PAST_RADIUS + N_PAST]
        speeds = row[PAST_SPEED : PAST_SPEED + N_PAST]
        x = out.radius_seen[n]
        write_predictor_input(r, row[GROWTH], age, radii, RADIUS_MIDDLE, RADIUS_SCALE, x)
        x = out.path_seen[n]
        write_predictor_input(v, 0.0, age, speeds, SPEED_MIDDLE, SPEED_SCALE, x)
        done, length = 0, 0.0
        for i in range(N_TIMES):
            while done < round(STEP_S * (i + 1) / DT):
                length += DT * math.hypot(row[VX], row[VY])
                advance_pedestrian(rules, state, 0, p, DT)
                done += 1
            out.radius[n, i] = (row[R] - r) / RADIUS_SCALE
            out.path[n, i] = (length / (STEP_S * (i + 1)) - v) / SPEED_SCALE


def watched(n: int, seed: int) -> Moments:
    """Return noiseless inputs and targets of ``n`` pedestrians at random moments."""
    rng = np.random.default_rng(seed)
    person = pedestrian_settings(load_cell(CELL).cylinders[0])
    usual, constant = person, type(person)(kind="constant")
    rules, state = pedestrian_rules([usual, constant]), pedestrian_state(1, 2)
    kinds = (rng.random(n) < CONSTANT_SHARE).astype(np.int64)
    periods = rng.integers(1, MOST_PERIODS, n)
    seen = np.zeros((2, n, N_IN), dtype=np.float32)
    said = np.zeros((2, n, N_TIMES), dtype=np.float32)
    out = Moments(seen[0], seen[1], said[0], said[1])
    _watch(rules, state, kinds, periods, seed, np.zeros(1, dtype=np.uint64), out)
    return out


def disturbed(
    seen: torch.Tensor, said: torch.Tensor, noise: float, rate_noise: float
) -> tuple[torch.Tensor, torch.Tensor]:
    """Return inputs and targets, some with a shorter past and some with noise.

    Args:
        seen: Inputs, (n, N_IN); not changed.
        said: Targets, (n, N_TIMES); not changed.
        noise: Largest standard deviation of the values, in the network's units.
        rate_noise: Largest standard deviation of the rate.
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
    """Return a network trained on inputs and targets.

    Args:
        seen: Inputs, (n, N_IN).
        said: Targets, (n, N_TIMES).
        noise: As in :func:`disturbed`.
        rate_noise: See there.
        n_updates: Number of minibatches.
    """
    net = nn.Sequential(*hidden(N_IN, WIDTH, 2), nn.Linear(WIDTH, N_TIMES))
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
    """Return a network of linear layers in the form of the kernels."""
    return Network(*(np.array(p.detach().numpy().T, order="C") for p in net.parameters()))


def make(n_pedestrians: int, n_updates: int, seed: int) -> tuple[Network, Network]:
    """Return trained networks for radius and path length."""
    torch.manual_seed(seed)
    moments, rate = watched(n_pedestrians, seed), MOST_NOISE / 0.05
    radius = MOST_NOISE / RADIUS_SCALE, rate
    speed = 5.0 * MOST_NOISE / SPEED_SCALE, 0.0
    return (
        network_of(fitted(moments.radius_seen, moments.radius, *radius, n_updates)),
        network_of(fitted(moments.path_seen, moments.path, *speed, n_updates)),
    )


def errors(network: Network, seen: Floats, said: Floats) -> Floats:
    """Return the root mean square error of a network at each time, (N_TIMES,)."""
    hidden = np.maximum(seen @ network.w1 + network.b1, 0.0)
    hidden = np.maximum(hidden @ network.w2 + network.b2, 0.0)
    off: Floats = hidden @ network.w3 + network.b3 - said
    return np.asarray(np.sqrt((off**2).mean(axis=0)), dtype=np.float32)


def constant_motion_errors(moments: Moments) -> tuple[Floats, Floats]:
    """Return the errors of constant growth within the limits, and of constant speed."""
    middle, scale = np.float32(RADIUS_MIDDLE), np.float32(RADIUS_SCALE)
    now, growth = scale * moments.radius_seen[:, :1] + middle, moments.radius_seen[:, 1:2]
    settings = pedestrian_settings(load_cell(CELL).cylinders[0])
    grown = (
        np.clip(now + growth * AHEAD.astype(np.float32), settings.r_min, settings.r_max) - now
    )
    radius = np.sqrt(((grown / scale - moments.radius) ** 2).mean(axis=0))
    return np.asarray(radius), np.asarray(np.sqrt((moments.path**2).mean(axis=0)))


def write_networks(radius: Network, path: Network, file: Path = FILE) -> None:
    """Write networks as the shipped file."""
    arrays = {
        f"{kind}.{field}": getattr(network, field)
        for kind, network in zip(KINDS, (radius, path), strict=True)
        for field in Network._fields
    }
    file.parent.mkdir(parents=True, exist_ok=True)
    np.savez(file, **arrays)


def main() -> None:
    """Train, report errors on other pedestrians, and write the networks."""
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    torch.set_num_threads(1)
    radius, path = make(N_WALKERS, N_UPDATES, SEED)
    other = watched(50_000, SEED + 1)
    kinds = (
        (
            "radius",
            np.full(N_TIMES, 1e3 * RADIUS_SCALE),
            errors(radius, other.radius_seen, other.radius),
        ),
        ("path length", 1e3 * SPEED_SCALE * AHEAD, errors(path, other.path_seen, other.path)),
    )
    for (name, unit, off), plain in zip(kinds, constant_motion_errors(other), strict=True):
        logger.info(
            "%s: root mean square error [mm] at %s s: %s; of constant motion: %s",
            name,
            AHEAD[REPORTED].round(2),
            (unit * off)[REPORTED].round(1),
            (unit * plain)[REPORTED].round(1),
        )
    write_networks(radius, path)


if __name__ == "__main__":
    parser_of(__doc__).parse_args()
    main()
