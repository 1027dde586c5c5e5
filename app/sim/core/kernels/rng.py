"""Counter-based random numbers: a stream per (seed, environment, episode), compiled.

A stream is a splitmix64 sequence whose start is a hash of its key, so that an episode draws the
same numbers alone, in a batch, and in any order.

Source: Steele, Lea, Flood, *Fast splittable pseudorandom number generators* (OOPSLA 2014).
"""

import math

import numpy as np
from numpy.typing import NDArray

from app.sim.core.jit import kernel

State = NDArray[np.uint64]

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_MIX_1 = np.uint64(0xBF58476D1CE4E5B9)
_MIX_2 = np.uint64(0x94D049BB133111EB)


@kernel(inline="always")
def _mix(z: np.uint64) -> np.uint64:
    z = (z ^ (z >> np.uint64(30))) * _MIX_1
    z = (z ^ (z >> np.uint64(27))) * _MIX_2
    return z ^ (z >> np.uint64(31))


@kernel()
def start_stream(seed: int, env: int, episode: int, state: State) -> None:
    """Set ``state``, shape (1,), to the start of one episode's stream."""
    z = _mix(np.uint64(seed) + _GOLDEN)
    z = _mix(z ^ (np.uint64(env) + _GOLDEN))
    state[0] = _mix(z ^ (np.uint64(episode) + _GOLDEN))


@kernel()
def split_stream(state: State, branch: int, child: State) -> None:
    """Set ``child``, shape (1,), to an independent stream; advances ``state`` by one draw.

    Args:
        state: Stream to branch off from.
        branch: Number of the branch; different branches give different streams.
        child: Filled.
    """
    state[0] = state[0] + _GOLDEN
    child[0] = _mix(_mix(state[0]) ^ (np.uint64(branch) + _GOLDEN))


@kernel()
def uniform(state: State) -> float:
    """Draw from [0, 1) and advance the stream."""
    state[0] = state[0] + _GOLDEN
    return float(_mix(state[0]) >> np.uint64(11)) * (1.0 / 9007199254740992.0)


@kernel()
def below(state: State, n: int) -> int:
    """Draw an integer from 0 to n - 1."""
    return min(int(uniform(state) * n), n - 1)


@kernel()
def normal(state: State) -> float:
    """Draw from the standard normal distribution (Box-Muller, one of the pair)."""
    radius = math.sqrt(-2.0 * math.log(1.0 - uniform(state)))
    return radius * math.cos(2.0 * math.pi * uniform(state))
