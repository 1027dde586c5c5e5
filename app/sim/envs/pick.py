"""The pick scenario as Gymnasium environments, single and vectorised."""

from collections.abc import Sequence

from gymnasium.vector import AutoresetMode

from app.sim.cells.cell import Cell
from app.sim.envs.arguments import cell_of, env_number, settings_with
from app.sim.envs.single_env import SingleEnv
from app.sim.envs.tasks import RobotTask
from app.sim.envs.vector_env import BatchVectorEnv
from app.sim.pick.batch import WHOLE_PICK, PickBatch, PickSettings
from app.sim.scene.scene import HumanKind


class PickEnv(SingleEnv):
    """A UR10 picks cubes, or sets them down at docks, beside people, usually one worker.

    | id | people |
    |----|--------|
    | ``tandem/Pick-v0`` | the cell's own person: an 18-DoF worker at the same table |
    | ``tandem/PickWalker-v0`` | a pedestrian of varying speed and radius (docs/method.md 2.1) |
    | ``tandem/PickConstant-v0`` | a pedestrian of constant speed and radius per episode |
    | ``tandem/PickFixedSpeed-v0`` | a pedestrian that walks at 0.5 m/s |
    | ``tandem/PickAlone-v0`` | none |

    ``people=("worker", "walker")`` selects any combination of up to four people.
    ``gymnasium.make_vec`` returns a :class:`PickVectorEnv`.

    ## Task
    Bring the tool over the object, descend, hold it there while the gripper closes, and come up
    again, without touching a person, the table or itself; ``pick/kernels/grasp.py`` has the
    phases. ``PickSettings(grasp=REACH_ONLY)``, the default of the settings, is the task of the
    thesis: bring the tool within 0.1 m of the target, its axis within 0.2 rad of the vertical,
    slower than 0.1 m/s.

    ## Action space
    ``Box(-1, 1, (5,), float32)``: desired speeds of the first five joints at the end of the
    control period (0.05 s), as fractions of their limits (0.5 rad/s). They are clipped to those
    that a second-degree polynomial can reach within position, speed and acceleration limits
    in this and all later periods; no action violates a limit. The sixth joint is held at 0.
    ``settings.action`` selects other action types (docs/method.md 2.2).

    | index | joint          | limits of the joint [rad] |
    |-------|----------------|---------------------------|
    | 0     | shoulder pan   | -3.1 .. 3.1               |
    | 1     | shoulder lift  | -3.3 .. 0.2               |
    | 2     | elbow          | -2.8 .. 2.8               |
    | 3     | wrist 1        | -6.2 .. 6.2               |
    | 4     | wrist 2        | -6.2 .. 6.2               |

    ## Observation space
    ``Box(-100, 100, (N_PICK,), float32)``; ``PICK_SIZES`` in
    ``app.sim.pick.kernels.observation_layout`` has the size of each group:

    | group | size | content |
    |-------|------|---------|
    | q, qd, sin_q, cos_q | 4 x 5 | controlled joints: angle / pi, speed / limit, sine, cosine |
    | human_q | 18 | the person's joints: x, y - 1.25 [m], yaw + pi / 2 and 15 more [rad] |
    | human_qd | 18 | half their speeds [m/s, rad/s] |
    | tcp, tool_axis | 2 x 3 | [m], unit vector |
    | goal_minus_tcp | 3 | twice the offset of the target [m] |
    | tcp_velocity | 3 | twice the velocity of the tcp [m/s] |
    | hands_and_elbows | 36 | hands and elbows from tcp, target, robot's elbow [m] |
    | hand_velocities | 6 | [m/s] |
    | goal_posture_minus_q, base | 2 x 5 | offset of the target's q [rad]; base motion |
    | distance_tilt_clearance_time | 4 | twice the distance of tcp and target [m], tilt [rad], |
    | | | clearance to the person [0.5 m], time left [10 s], at most 100 |
    | nearest_by_group | 4 x 4 | distance [0.5 m] and direction of the person, by links |
    | look_ahead_still, look_ahead_base | 2 x 3 | clearance in 0.25, 0.5, 1 s [0.5 m]: robot |
    | | | at rest, along the base motion |
    | goal_clearance | 4 | clearance of the configuration at the object [0.5 m], now and in |
    | | | 0.25, 0.5, 1 s |
    | phase, closing | 3 + 1 | one-hot; share of the closing time |
    | near_clearance | 1 | clearance [0.1 m], at most 1 |
    | second_... | 44 | pelvis, hands, elbows and clearances of a second person |

    Values marked [0.5 m] are in units of 0.5 m and at most 3. Clearances are those of five
    capsules, one per link from the upper arm to the tool, to the person above the hips; exact
    ones of the whole robot and person decide on contacts and on the phase.

    The person nearest to the robot is observed, and of the others the one nearest to the
    target; a cylinder as a person standing in it, an empty cell as a person far away.
    ``PickSettings(observation="features")`` ends before the phase, for a task without grasp:
    ``N_FEATURES`` numbers. ``PickSettings(observation="state")`` is the raw state (5.8), 51
    numbers: q, qd of the robot (2 x 6) and the person (2 x 18) [rad, rad/s, m, m/s], and the
    target [m].
    ``PickSettings(observation="body")`` adds the body dimensions of the observed person, 12
    numbers: the lengths of ``app.sim.human.anthropometry.NAMES`` [m], with the present height
    of the pelvis, and the girth; ``N_WITH_BODY`` in total.

    ## Reward
    ``c_d (d_old - gamma d) + c_th (th_old - gamma th) - c_c [collision] - c_step
    - c_v |v_tcp| [d <= d_v] + c_s [success]``; coefficients in ``PickSettings.weights``.

    ## Start
    The robot rests at home, a cube or a dock in about equal shares; the target is another
    station, drawn uniformly; a worker is at a random time of a random script of primitives, a
    cylinder anywhere in its area. Starts nearer to a person than ``start_clearance_m`` (0.05 m)
    are drawn again, unless ``settings.start`` is ``uniform``.

    ## End
    Success, collision and timeout (12 s) *terminate*: the time left is observed, so a timeout
    is part of the task. Without it (``observation="state"``) a timeout *truncates*.
    ``info["outcome"]`` names the outcome; one-step bounds add *unfeasible*.

    ## Randomness
    Target, start and the people's motion. Episode ``k`` after ``reset(seed=s)`` depends only on
    (s, first_env, k) and equals episode ``k`` of environment ``first_env`` of a
    ``PickVectorEnv`` with that seed, bit for bit.

    Args:
        cell: Name of a shipped work cell, or a work cell.
        settings: Settings of the scenario.
        people: People in the cell, 0 to 4 kinds; None for those of the settings.
        first_env: Number of the equal environment in a vector environment.
        render_mode: ``rgb_array`` or None; ``metadata["render_fps"]`` is the control rate.

    Source: thesis section 5.3. Deviates: features are added to the raw state (5.8), actions are
    desired speeds instead of coefficients (``pick/kernels/observation.py``,
    ``pick/kernels/reward.py``).
    """

    def __init__(
        self,
        cell: str | Cell = "pick-and-place",
        settings: PickSettings | None = None,
        people: Sequence[HumanKind] | None = None,
        first_env: int = 0,
        render_mode: str | None = None,
    ) -> None:
        chosen = settings_with(settings, WHOLE_PICK, people)
        first = env_number("first_env", first_env)
        self.batch = PickBatch(cell_of(cell), 1, 0, chosen, first)
        super().__init__(RobotTask(self.batch), render_mode)


class PickVectorEnv(BatchVectorEnv):
    """Many environments :class:`PickEnv`, stepped together.

    Arguments are those of :class:`PickEnv` and :class:`BatchVectorEnv`; ``first_env`` is the
    number of the first of ``num_envs`` environments.
    """

    def __init__(
        self,
        num_envs: int = 1,
        cell: str | Cell = "pick-and-place",
        settings: PickSettings | None = None,
        people: Sequence[HumanKind] | None = None,
        first_env: int = 0,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
    ) -> None:
        chosen = settings_with(settings, WHOLE_PICK, people)
        first, n = env_number("first_env", first_env), env_number("num_envs", num_envs, 1)
        self.batch = PickBatch(cell_of(cell), n, 0, chosen, first)
        task = RobotTask(self.batch)
        super().__init__(task, render_mode, autoreset_mode, max_episode_steps)
