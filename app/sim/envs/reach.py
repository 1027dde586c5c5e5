"""The reach scenario as Gymnasium environments, single and vectorised."""

from collections.abc import Sequence

from gymnasium.vector import AutoresetMode

from app.sim.cells.cell import Cell
from app.sim.envs.arguments import cell_of, env_number, settings_with
from app.sim.envs.single_env import SingleEnv
from app.sim.envs.tasks import RobotTask
from app.sim.envs.vector_env import BatchVectorEnv
from app.sim.reach.batch import ReachSettings
from app.sim.reach.blocked_batch import new_reach_batch
from app.sim.scene.scene import HumanKind


class ReachEnv(SingleEnv):
    """A UR10 reaches goals over a table while people walk through its workspace.

    | id | people |
    |----|--------|
    | ``tandem/Reach-v0`` | a pedestrian of varying speed and radius (docs/method.md 2.1) |
    | ``tandem/ReachConstant-v0`` | a pedestrian of constant speed and radius per episode |
    | ``tandem/ReachFixedSpeed-v0`` | a pedestrian that walks at 0.5 m/s |
    | ``tandem/ReachWorker-v0`` | an 18-DoF worker at the table who reaches over it |
    | ``tandem/ReachAlone-v0`` | none |

    ``people=("worker", "walker")`` selects any combination of up to four people.
    ``gymnasium.make_vec`` returns a :class:`ReachVectorEnv`.

    ## Task
    Bring the tcp within 0.1 m of the goal without touching a person, the table or itself.
    Orientation and speed of the tool are free.

    ## Action space
    ``Box(-1, 1, (6,), float32)``: desired speeds of the joints at the end of the control period
    (0.02 s), as fractions of their limits (1 rad/s). They are clipped to those that a
    second-degree polynomial can reach within position, speed and acceleration limits in this
    and all later periods; no action violates a limit. ``settings.action`` selects other action
    types (docs/method.md 2.2).

    | index | joint          | limits of the joint [rad] |
    |-------|----------------|---------------------------|
    | 0     | shoulder pan   | -3.1 .. 3.1               |
    | 1     | shoulder lift  | -3.3 .. 0.2               |
    | 2     | elbow          | -2.8 .. 2.8               |
    | 3     | wrist 1        | -6.2 .. 6.2               |
    | 4     | wrist 2        | -6.2 .. 6.2               |
    | 5     | wrist 3        | -6.2 .. 6.2               |

    ## Observation space
    ``Box(-100, 100, (N_FEATURES,), float32)``; ``app.sim.reach.kernels.observation.LAYOUT`` has
    the slice of each group:

    | group | size | content |
    |-------|------|---------|
    | q, qd | 2 x 6 | joints: angle / pi, speed / limit |
    | human | 5 | the person's x, y - 1.25, vx, vy, radius [m, m/s] |
    | goal | 3 | [m] |
    | sin_q, cos_q | 2 x 6 | of the joints |
    | tcp | 3 | [m] |
    | goal_minus_tcp | 3 | twice the offset of the goal [m] |
    | tcp_velocity | 3 | [m/s] |
    | human_minus_tcp, _elbow, _goal | 3 x 2 | the person's axis from each [m] |
    | clearance | 1 | distance of robot and people [0.5 m], at most 3 |
    | look_ahead | 3 | the same in 0.25, 0.5, 1 s: robot at rest, people at constant velocity |
    | distance | 1 | twice the distance of tcp and goal [m] |
    | time_left | 1 | [2.5 s], at most 100 |
    | base | 6 | action of the base controller |
    | look_ahead_base | 3 | clearance in 0.25, 0.5, 1 s along the base motion [0.5 m] |
    | human_growth | 1 | twice the growth of the radius [m/s] |
    | approach | 4 x 2 | time [2 s] and distance [0.5 m] of the closest approach to the |
    | | | moving tcp, the tcp at rest, the moving elbow, the goal |
    | goal_gap | 4 | distance of person and goal now and in 0.25, 0.5, 1 s [0.5 m] |
    | group_gap | 3 x 3 | distance [0.5 m] and direction of the person: arm, forearm, wrists |

    ``ReachSettings(observation="forecast")`` appends the option features (``LAYOUT`` of
    ``app.sim.reach.kernels.option_features``), with people as
    ``app.sim.prediction.kernels.networks`` predicts:

    | group | size | content |
    |-------|------|---------|
    | arrival | 1 | time to the goal of the base motion [s], at most 100 |
    | base_clearance | 9 | clearance along it in 0.04 to 1.28 s, the least [0.2 m], -1 to 2 |
    | aside_clearance | 4 x 9 | the same at rest, toward home, and to either side of home |
    | goal_gap_ahead | 8 | distance of person and goal at these times [0.5 m] |
    | radius_ahead | 8 | change of the person's radius [0.2 m] |

    The nearest person is observed; a worker as the cylinder about the pelvis that contains the
    body, an empty cell as a person far away. Clearances consider all people, except
    look_ahead_base: the observed person alone, as that cylinder.

    ``ReachSettings(observation="state")`` selects the raw state (4.30), 20 numbers:

    | index | content | unit |
    |-------|---------|------|
    | 0..5 | q | rad |
    | 6..11 | qd | rad/s |
    | 12, 13 | the person's x, y | m |
    | 14, 15 | vx, vy | m/s |
    | 16 | r | m |
    | 17..19 | goal x, y, z | m |

    ## Reward
    ``c_p (d_old - gamma d) - c_d d - c_a |c| - c_step - c_c [collision] + c_s [success]``, with
    ``d`` the distance of tcp and goal [m], ``c`` the period's second coefficients [rad/s^2].
    Coefficients in ``ReachSettings.weights``: by default those of thesis table 4.1 (c_d 1, c_a
    0.1, c_c 5, c_s 20, others 0); presets have their own (``policies/configs/reach.py``).

    ## Start
    The robot rests at home; the goal is one of the 54 points of the cell's grid, one of the
    ``n_halton`` points of a Halton set (``goals="halton"``), or anywhere in the box of both
    (``goals="box"``). Cylinders start anywhere in their area, workers at a random time
    of a random script of reaches. ``start="clearance"`` draws people again that are nearer than
    0.05 m; ``"uniform"`` does not; ``"authors"`` does not, and people walk as in the authors'
    code.

    ## End
    Success and collision *terminate*; so does a timeout (5 s) if the time left is observed;
    otherwise (``observation="state"``) it *truncates*. With ``collision_ends=False`` an episode
    continues after a collision and counts as a collision at its end; with ``blocked=`` rules a
    contact also blocks the arm (``app.sim.reach.blocked_batch``, with its reward).
    ``info["outcome"]`` names the outcome; one-step bounds add *unfeasible*.

    ## Randomness
    Goal, start and the people's motion. Episode ``k`` after ``reset(seed=s)`` depends only on
    (s, first_env, k) and equals episode ``k`` of environment ``first_env`` of a
    ``ReachVectorEnv`` with that seed, bit for bit.

    Args:
        cell: Name of a shipped work cell with a goal region, or a work cell.
        settings: Settings of the scenario.
        people: People in the cell, 0 to 4 kinds; None for those of the settings.
        first_env: Number of the equal environment in a vector environment.
        render_mode: ``rgb_array`` or None; ``metadata["render_fps"]`` is the control rate.

    Source: thesis chapter 4, docs/method.md 2.1 to 2.3. Deviates: features are added to the raw
    state (4.30), actions are desired speeds instead of coefficients, no action is *unfeasible*.
    """

    def __init__(
        self,
        cell: str | Cell = "shared-workspace",
        settings: ReachSettings | None = None,
        people: Sequence[HumanKind] | None = None,
        first_env: int = 0,
        render_mode: str | None = None,
    ) -> None:
        chosen = settings_with(settings, ReachSettings(), people)
        first = env_number("first_env", first_env)
        self.batch = new_reach_batch(cell_of(cell), 1, 0, chosen, first)
        super().__init__(RobotTask(self.batch), render_mode)


class ReachVectorEnv(BatchVectorEnv):
    """Many environments :class:`ReachEnv`, stepped together.

    Arguments are those of :class:`ReachEnv` and :class:`BatchVectorEnv`; ``first_env`` is the
    number of the first of ``num_envs`` environments.
    """

    def __init__(
        self,
        num_envs: int = 1,
        cell: str | Cell = "shared-workspace",
        settings: ReachSettings | None = None,
        people: Sequence[HumanKind] | None = None,
        first_env: int = 0,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
    ) -> None:
        chosen = settings_with(settings, ReachSettings(), people)
        first, n = env_number("first_env", first_env), env_number("num_envs", num_envs, 1)
        self.batch = new_reach_batch(cell_of(cell), n, 0, chosen, first)
        task = RobotTask(self.batch)
        super().__init__(task, render_mode, autoreset_mode, max_episode_steps)
