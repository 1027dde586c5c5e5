"""The pick scenario as a Gymnasium environment, a thin view of one row of ``PickBatch``."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray

from app.sim.cells import Cell, load_cell
from app.sim.kernels.arm import CONTROLLED
from app.sim.kernels.features import N_FEATURES
from app.sim.pick import OUTCOMES, PickBatch, PickSettings

Obs = NDArray[np.float32]

OBS_BOUND = 100.0
"""Bound of the observation space; features are scaled to a few units."""


class PickEnv(gymnasium.Env[Obs, Obs]):
    """A UR10 reaches for cubes and docks beside a person who works at the same table.

    ## Task
    Bring the tool within 0.1 m of the target, its axis within 0.2 rad of the vertical, slower
    than 0.1 m/s, without touching the person, the table or itself.

    ## Action space
    ``Box(-1, 1, (5,), float32)``: wanted speeds of the first five joints at the end of the
    control period (0.05 s), as shares of their limits (0.5 rad/s). They are clipped to what a
    second-degree polynomial can reach without leaving position, speed and acceleration limits,
    now or later; no action breaks a limit. The sixth joint is held at 0.

    | index | joint          | limits of the joint [rad] |
    |-------|----------------|---------------------------|
    | 0     | shoulder pan   | -3.1 .. 3.1               |
    | 1     | shoulder lift  | -3.3 .. 0.2               |
    | 2     | elbow          | -2.8 .. 2.8               |
    | 3     | wrist 1        | -6.2 .. 6.2               |
    | 4     | wrist 2        | -6.2 .. 6.2               |

    ## Observation space
    ``Box(-100, 100, (N_FEATURES,), float32)``; ``app.sim.kernels.features.LAYOUT`` gives the
    slice of each group, in this order:

    | group | size | content |
    |-------|------|---------|
    | q, qd, sin_q, cos_q | 4 x 5 | controlled joints: angle / pi, speed / limit, sine, cosine |
    | human_q, human_qd | 2 x 18 | the person's joints [m, rad] and half their speeds |
    | tcp, goal_minus_tcp, tcp_velocity, tool_axis | 4 x 3 | tool and target [m, m/s] |
    | hands_and_elbows | 36 | hands and elbows from tcp, target, robot's elbow [m] |
    | hand_velocities | 6 | [m/s] |
    | goal_posture_minus_q, base | 2 x 5 | way to the target's posture [rad], straight move |
    | distance_tilt_clearance_time | 4 | how far, how tilted, how near the person, time left |
    | nearest_by_group | 16 | distance and direction of the person, four groups of links |
    | look_ahead_still, look_ahead_base | 2 x 3 | clearances in 0.25, 0.5 and 1 s |
    | goal_clearance | 4 | clearance of the target's posture now and then |

    ## Reward
    ``c_d (d_old - gamma d) + c_th (th_old - gamma th) - c_c [collision] - c_step
    - c_v |v_tcp| [d <= d_v] + c_s [success]``; ``PickSettings.weights`` holds the coefficients.

    ## Start
    The robot rests at home, a cube or a dock in equal shares; the target is another station,
    drawn uniformly; the person is at a random time of a random script of reaches. Starts nearer
    to the person than ``start_clearance_m`` (0.05 m) are drawn again.

    ## End
    Success, collision and time-out (20 s) all *terminate*: the time left is observed, so a
    time-out is part of the task. ``truncated`` is never set. ``info["outcome"]`` names the end.

    ## Randomness
    Episode ``k`` after ``reset(seed=s)`` is fixed by (s, k) and equals episode ``k`` of row 0
    of a ``PickBatch`` with that seed, bit for bit.

    Args:
        cell: Name of a shipped work cell, or a work cell.
        settings: Starts, ends and rewards.

    Source: thesis section 5.3. Deviates: features are added to the raw state (5.8), actions are
    wanted speeds instead of coefficients (``kernels/features.py``, ``kernels/reward.py``).
    """

    metadata = {"render_modes": [], "render_fps": 20}

    def __init__(
        self, cell: str | Cell = "pick-and-place", settings: PickSettings | None = None
    ) -> None:
        chosen = load_cell(cell) if isinstance(cell, str) else cell
        self.batch = PickBatch(chosen, 1, 0, settings or PickSettings())
        self.action_space = spaces.Box(-1.0, 1.0, (CONTROLLED,), np.float32)
        self.observation_space = spaces.Box(-OBS_BOUND, OBS_BOUND, (N_FEATURES,), np.float32)
        self._running = False
        self._seeded = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Obs, dict[str, Any]]:
        """Start episode 0 of a seed, or the next episode where no seed is given.

        Args:
            seed: Seed of this and the following episodes.
            options: ``{"episode": k}`` starts episode ``k`` instead.
        """
        super().reset(seed=seed)
        if seed is None and not self._seeded:
            seed = int(self.np_random.integers(2**31))
        if seed is not None:
            self.batch.seed, self._seeded = seed, True
            self.batch.state.episode[:] = 0
        else:
            self.batch.state.episode[:] += 1
        if options and "episode" in options:
            self.batch.state.episode[:] = int(options["episode"])
        self._running = True
        return self.batch.restart()[0].copy(), self._info()

    def step(self, action: Obs) -> tuple[Obs, float, bool, bool, dict[str, Any]]:
        """Move through one control period.

        Args:
            action: Wanted joint speeds over their limits, in [-1, 1], shape (5,).

        Raises:
            ResetNeeded: The episode has ended.
            SimulationError: The action is NaN or infinite.
        """
        if not self._running:
            raise ResetNeeded("the episode has ended: call reset() before the next step()")
        act = np.asarray(action, dtype=np.float32).reshape(1, CONTROLLED)
        result = self.batch.step(act, auto_reset=False)
        terminated = bool(result.ended[0])
        self._running = not terminated
        return result.obs[0].copy(), float(result.rew[0]), terminated, False, self._info()

    def _info(self) -> dict[str, Any]:
        state = self.batch.state
        return {
            "outcome": OUTCOMES[int(state.outcome[0])],
            "episode": int(state.episode[0]),
            "clearance_m": float(state.clear[0, 0]),
            "time_left_s": float(state.time_left[0]),
        }
