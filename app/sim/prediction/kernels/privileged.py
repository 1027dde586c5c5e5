"""True future of pedestrians, as privileged observation of a critic (compiled).

A pedestrian does not react to the robot and draws from its own random stream, so a copy of its
state walks exactly as the pedestrian will. Policies never observe this; an asymmetric critic
may during training.
"""

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.people.kernels.pedestrian import (
    N_STATE,
    PedestrianRules,
    PedestrianState,
    R,
    X,
    Y,
    advance_pedestrian,
)

AHEAD_S = (0.25, 0.5, 1.0, 2.0)
"""Times ahead [s]."""
N_AHEAD = 3 * len(AHEAD_S)
"""Numbers per pedestrian: x and y relative to now [m] and radius [m] at each time."""


@kernel(nogil=True)
def write_privileged_future(
    rules: PedestrianRules, state: PedestrianState, copy: PedestrianState, dt: float, out: Vec
) -> None:
    """Write the future places of all pedestrians.

    Args:
        rules: Motion of the pedestrians.
        state: The pedestrians; not changed.
        copy: Work space of the same shapes.
        dt: Control cycle [s].
        out: Filled, shape (n_envs, W * N_AHEAD).
    """
    for e in range(state.rows.shape[0]):
        for p in range(state.rows.shape[1]):
            for i in range(N_STATE):
                copy.rows[e, p, i] = state.rows[e, p, i]
            copy.stream[e, p, 0] = state.stream[e, p, 0]
            done, k = 0, p * N_AHEAD
            for ahead in AHEAD_S:
                until = round(ahead / dt)
                while done < until:
                    advance_pedestrian(rules, copy, e, p, dt)
                    done += 1
                out[e, k] = copy.rows[e, p, X] - state.rows[e, p, X]
                out[e, k + 1] = copy.rows[e, p, Y] - state.rows[e, p, Y]
                out[e, k + 2] = copy.rows[e, p, R]
                k += 3
