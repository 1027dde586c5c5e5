"""Training configuration of the pick scenario: TD3 (docs/method.md 3.3, 3.5).

Deviates: the values of thesis table 5.2 are replaced by values that learn in minutes (residual
action, features, n-step returns, parallel environments). No preset has the source's values.
"""

from typing import Literal, Self

from pydantic import model_validator

from app.errors import InvalidInput, digits
from app.policies.configs.fields import (
    CellName,
    FieldGroup,
    TrainingConfig,
    Whole,
    choice,
    number,
)
from app.policies.configs.td3 import (
    ActionConfig,
    ActorCriticNetworks,
    NoiseExploration,
    TD3Learning,
)
from app.sim.pick.kernels.grasp import REACH_ONLY as GRASP_NOTHING
from app.sim.pick.kernels.grasp import GraspRules


class PickExploration(NoiseExploration):
    """AR(1) noise, and temporally extended options in half of the noisy environments."""

    option_rate: float = number(0.02, 0.0, 0.5, "per step", "Start rate of options")


class PickNetworks(ActorCriticNetworks):
    """Sizes of actor and critics, and the values of targets."""

    target_value: Literal["mean", "least"] = choice(
        "mean", "Target value: the mean of the critics, or the least as in TD3"
    )


class PickEpisode(FieldGroup):
    """Starts, ends and observations of episodes."""

    task: Literal["pick", "reach"] = choice(
        "pick", "Task: descend, close and lift at the target, or only reach it"
    )
    time_limit_s: float = number(20.0, 1.0, 60.0, "s", "Time limit")
    short_limit_s: float = number(12.0, 1.0, 60.0, "s", "Time limit of short episodes")
    short_share: float = number(0.5, 0.0, 1.0, "", "Share of short episodes")
    start_clearance_m: float = number(
        0.05, 0.0, 1.0, "m", "Start clearance: least distance of robot and people"
    )
    target_jitter_m: float = number(
        0.04, 0.0, 0.2, "m", "Target jitter: half width of the box around a station"
    )
    on_path_share: float = number(
        0.15, 0.0, 1.0, "", "Share of episodes that start part of the path to the target"
    )
    at_target_share: float = number(
        0.1, 0.0, 1.0, "", "Share of episodes that start at the target"
    )
    anywhere_share: float = number(
        0.2, 0.0, 1.0, "", "Share of targets and of starts drawn away from the stations"
    )
    safety: Literal["none", "ssm"] = choice(
        "none", "Safety layer: none, or speed and separation monitoring"
    )
    observation: Literal["features", "body", "phase", "two-people"] = choice(
        "two-people",
        "Observation: features of one person; also the anthropometry; also the phase of the "
        "pick; also a second person",
    )

    @property
    def grasp(self) -> GraspRules:
        """The phases of the task, for the scenario."""
        return GraspRules() if self.task == "pick" else GRASP_NOTHING

    @model_validator(mode="after")
    def _check(self) -> Self:
        """Check the time limits against each other, and the observation against the task.

        Raises:
            InvalidInput: The short limit is the longer one, or a pick has no phase.
        """
        sees_phase = self.observation in ("phase", "two-people")
        if sees_phase != (self.task == "pick"):
            rule = f"must {'not ' if sees_phase else ''}contain the phase: task = {self.task}"
            raise InvalidInput("episode.observation", self.observation, rule)
        if self.short_limit_s > self.time_limit_s:
            rule = f"must not exceed time_limit_s = {digits(self.time_limit_s)} s"
            raise InvalidInput("episode.short_limit_s", self.short_limit_s, rule)
        return self


class PickPeople(FieldGroup):
    """People in the cell."""

    n_people: Whole = number(2, 1, 4, "", "People: the policy observes the nearest one")
    human_motion: Literal["library", "reaches"] = choice(
        "library", "Motion: movement primitives of the task, or synthetic reaches"
    )
    augmentation: Literal["sampled", "replayed"] = choice(
        "sampled", "Augmentation: primitives are sampled, or demonstrations replayed"
    )
    human_absent: float = number(0.35, 0.0, 1.0, "", "Share of absent people per episode")
    human_off_task: float = number(0.3, 0.0, 1.0, "", "Share of people who are off task")
    human_at_rest: float = number(
        0.25, 0.0, 1.0, "", "Share of people who stand still for 5 to 20 s of an episode"
    )
    human_pace: float = number(0.6, 0.2, 2.0, "", "Pace: 1 is the pace of the primitives")
    human_pace_max: float = number(
        2.0, 0.2, 4.0, "", "Greatest pace: a person's is drawn per episode, from human_pace on"
    )
    human_yielding: float = number(0.0, 0.0, 1.0, "", "Yielding to the robot: 0 ignores it")


class PickReward(FieldGroup):
    """Coefficients of the reward."""

    c_d: float = number(1.0, 0.0, 10.0, "1/m", "Progress reward weight c_d")
    c_th: float = number(0.25, 0.0, 10.0, "1/rad", "Uprightness weight c_th")
    c_c: float = number(5.0, 0.0, 100.0, "", "Collision cost c_c: at the start")
    c_c_end: float = number(
        10.0, 0.0, 100.0, "", "Final collision cost: c_c grows to it linearly"
    )
    c_step: float = number(0.02, 0.0, 1.0, "", "Time cost c_step: per control cycle")
    c_v: float = number(0.0, 0.0, 10.0, "s/m", "Speed cost c_v: TCP speed near the target")
    d_v: float = number(0.1, 0.0, 1.0, "m", "Range d_v of the speed cost")
    c_s: float = number(4.0, 0.0, 100.0, "", "Success bonus c_s")


PICK_LEARNING = TD3Learning(
    total_steps=12_288_000,
    batch_size=512,
    lr_end=2e-5,
    gamma=0.995,
    policy_delay=2,
    actor_frozen_updates=3_000,
)


class PickPreset(TrainingConfig):
    """TD3 on the pick scenario; the defaults are those of ``pick-td3``."""

    name: str = "pick-td3"
    cell: CellName = "pick-and-place"
    learning: TD3Learning = PICK_LEARNING
    networks: PickNetworks = PickNetworks()
    exploration: PickExploration = PickExploration(greedy_share=0.125)
    episode: PickEpisode = PickEpisode()
    people: PickPeople = PickPeople()
    action: ActionConfig = ActionConfig()
    reward: PickReward = PickReward()


REACH_ONLY = PickPreset(
    name="pick-reach-td3",
    learning=PICK_LEARNING.model_copy(
        update={"total_steps": 9_216_000, "gamma": 0.993, "lr_end": 3e-5}
    ),
    networks=PickNetworks(target_value="least"),
    episode=PickEpisode(
        task="reach",
        short_limit_s=10.0,
        at_target_share=0.0,
        anywhere_share=0.0,
        observation="features",
    ),
    people=PickPeople(
        human_off_task=0.2, human_at_rest=0.0, human_pace=1.0, human_pace_max=1.0
    ),
    reward=PickReward(c_step=0.005, c_c_end=5.0),
)
"""The task without a grasp: a target counts when it is reached, as in the thesis."""
MONITORED = PickPreset(name="pick-td3-monitored", episode=PickEpisode(safety="ssm"))
"""``pick-td3`` under speed and separation monitoring; a person may touch the robot at
standstill."""
PICK_PRESETS = (PickPreset(), REACH_ONLY, MONITORED)
