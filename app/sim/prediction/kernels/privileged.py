"""Where walkers will be: their own motion run ahead on a copy, compiled.

A walker does not react to the robot and draws from its own stream, so that a copy of its state
walks exactly as it will. Policies never see this; critics may, while they learn.
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
"""Numbers per walker: x and y relative to now [m] and radius [m] at each time."""


@kernel(nogil=True)
def look_ahead_of_walkers(
    rules: PedestrianRules, state: PedestrianState, copy: PedestrianState, dt: float, out: Vec
) -> None:
    """Write where all walkers will be.

    Args:
        rules: How the walkers walk.
        state: The walkers as they are; left alone.
        copy: Work space of the same shapes.
        dt: Control period [s].
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
