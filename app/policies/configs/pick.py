"""Training configuration of the pick scenario: TD3 (docs/method.md 3.3, 3.5).

Deviates: the values of thesis table 5.2 are replaced by values that learn in minutes (residual
action, features, n-step returns, parallel environments). ``pick-td3-thesis`` is the table.
"""

from typing import Literal, Self

from pydantic import model_validator

from app.errors import InvalidInput, digits
from app.policies.checkpoints.checkpoint import MAX_STATE_BYTES
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
from app.sim.pick.kernels.episode import N_PLAIN
from app.sim.pick.kernels.grasp import REACH_ONLY as GRASP_NOTHING
from app.sim.pick.kernels.grasp import GraspRules
from app.sim.robot.kernels.arm import CONTROLLED

SPARE_STATE_BYTES = 1 << 24
"""Bound of what a state has beside networks, perturbed actors, environments and priorities."""
ENV_BYTES = 1 << 15
"""Bound of what a state has of an environment, with four people."""
PRIORITY_BYTES = 32
"""Bound of what a state has of a transition in a replay memory with priorities."""


class PickLearning(TD3Learning):
    """TD3 whose learning curve may be measured in episodes of its own."""

    progress_episodes: Whole = number(
        0,
        0,
        10_000,
        "episodes",
        "Curve episodes: greedy, behind a point; 0 counts environments without exploration",
    )


class PickExploration(NoiseExploration):
    """AR(1) noise with options in half of the noisy environments, or parameter-space noise."""

    noise: Literal["ar1", "parameters"] = choice(
        "ar1", "Noise: AR(1) and options, or perturbed weights of the actor in each episode"
    )
    parameter_sigma: float = number(
        0.5, 0.01, 1.0, "", "Parameter-space noise σ: first of the weights, then of the action"
    )
    option_rate: float = number(0.02, 0.0, 0.5, "per step", "Start rate of options")


class PickNetworks(ActorCriticNetworks):
    """Kind of actor, sizes of actor and critics, and the values of targets."""

    actor: Literal["residual", "plain"] = choice(
        "residual",
        "Actor: residual to the nominal controller; or plain, with layer normalisation. "
        "Plain actors and their critics are Glorot-initialised",
    )
    critic: Literal["mean", "quantiles"] = choice(
        "mean", "Critic: expected return, or quantiles of it (TQC)"
    )
    target_value: Literal["mean", "least"] = choice(
        "mean",
        "Target value: the mean of the critics, or the least as in TD3; quantiles of all "
        "critics are pooled",
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        """Check that the values of targets fit the critics."""
        if self.critic == "quantiles" and self.target_value != "mean":
            raise InvalidInput(
                "networks.target_value", self.target_value, "needs critic = mean"
            )
        return self


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
    target_choice: Literal["uniform", "critic"] = choice(
        "uniform",
        "Targets: drawn uniformly; or the station of the greatest value at the start, which "
        "leaves others untrained (task maximisation bias)",
    )
    curriculum_steps: Whole = number(
        0,
        0,
        10_000_000,
        "env steps",
        "Curriculum: steps in which the mode, then the lower limit, of the distribution of "
        "starts moves from the target to the start; 0 has none",
    )
    timeout: Literal["as-observed", "terminates"] = choice(
        "as-observed", "Time-out: truncates an episode if its time is not observed, or ends it"
    )
    safety: Literal["none", "ssm"] = choice(
        "none", "Safety layer: none, or speed and separation monitoring"
    )
    observation: Literal["state", "features", "body", "phase", "two-people"] = choice(
        "two-people",
        "Observation: the raw state; features of one person; also the anthropometry; also the "
        "phase of the pick; also a second person",
    )

    @property
    def grasp(self) -> GraspRules:
        """The phases of the task, for the scenario."""
        return GraspRules() if self.task == "pick" else GRASP_NOTHING

    @property
    def sees_time(self) -> bool:
        """Whether a timeout is an end of the task, and no truncation."""
        return self.observation != "state" or self.timeout == "terminates"

    @model_validator(mode="after")
    def _check(self) -> Self:
        """Check time limits, and observation, curriculum and targets against the task."""
        sees_phase = self.observation in ("phase", "two-people")
        if sees_phase != (self.task == "pick"):
            rule = f"must {'not ' if sees_phase else ''}contain the phase: task = {self.task}"
            raise InvalidInput("episode.observation", self.observation, rule)
        if self.curriculum_steps and (
            self.safety != "none" or self.on_path_share or self.at_target_share
        ):
            rule = "needs safety = none, on_path_share = 0 and at_target_share = 0"
            raise InvalidInput("episode.curriculum_steps", self.curriculum_steps, rule)
        shares = self.on_path_share, self.at_target_share, self.anywhere_share
        drawn_elsewhere = any((self.target_jitter_m, *shares))
        if self.target_choice == "critic" and (
            self.curriculum_steps or self.safety != "none" or drawn_elsewhere
        ):
            rule = (
                "needs safety = none, curriculum_steps = 0, target_jitter_m = 0, "
                "on_path_share = 0, at_target_share = 0 and anywhere_share = 0"
            )
            raise InvalidInput("episode.target_choice", self.target_choice, rule)
        if self.short_limit_s > self.time_limit_s:
            rule = f"must not exceed time_limit_s = {digits(self.time_limit_s)} s"
            raise InvalidInput("episode.short_limit_s", self.short_limit_s, rule)
        return self


class PickPeople(FieldGroup):
    """People in the cell."""

    n_people: Whole = number(2, 1, 4, "", "People: the policy observes the nearest two")
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
        2.0, 0.2, 4.0, "", "Greatest pace: each episode draws a person's, at least Pace"
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
    c_step: float = number(0.02, 0.0, 1.0, "", "Time cost c_step: per control period")
    c_v: float = number(0.0, 0.0, 10.0, "s/m", "Speed cost c_v: TCP speed near the target")
    d_v: float = number(0.1, 0.0, 1.0, "m", "Range d_v of the speed cost")
    c_s: float = number(4.0, 0.0, 100.0, "", "Success bonus c_s")


PICK_LEARNING = PickLearning(
    total_steps=12_288_000,
    batch_size=512,
    gamma=0.995,
    policy_delay=2,
    actor_frozen_updates=3_000,
)


class PickPreset(TrainingConfig):
    """TD3 on the pick scenario; ``PICK`` is ``pick-td3``."""

    name: str = "pick-td3"
    cell: CellName = "pick-and-place"
    learning: PickLearning = PICK_LEARNING
    networks: PickNetworks = PickNetworks()
    exploration: PickExploration = PickExploration(greedy_share=0.125)
    episode: PickEpisode = PickEpisode()
    people: PickPeople = PickPeople()
    action: ActionConfig = ActionConfig()
    reward: PickReward = PickReward()

    @property
    def predicts_outcomes(self) -> bool:
        """Whether its checkpoints hold outcome probabilities, which need features."""
        return self.episode.observation != "state"

    @model_validator(mode="after")
    def _check(self) -> Self:
        """Check the groups against each other."""
        actor, episode = self.networks.actor, self.episode
        if (actor == "plain") != (episode.observation == "state"):
            rule = "must be plain with observation = state, and residual with features"
            raise InvalidInput("networks.actor", actor, rule)
        if self.action.meaning == "coefficient" and (
            actor == "residual" or self.action.degree == 3
        ):
            rule = "must be speed with actor = residual, or with degree = 3"
            raise InvalidInput("action.meaning", self.action.meaning, rule)
        if self.exploration.noise == "parameters":
            self._check_parameter_noise()
        else:
            self._check_noise()
        return self

    def _check_parameter_noise(self) -> None:
        """Check that actors can be perturbed, and that their copies fit into a state."""
        noise, learning, networks = self.exploration.noise, self.learning, self.networks
        if networks.actor != "plain" or learning.progress_episodes == 0:
            rule = "needs actor = plain and progress_episodes above 0"
            raise InvalidInput("exploration.noise", noise, rule)
        # Weights, biases and the gains and shifts of the normalisation.
        per_unit = (networks.layers - 1) * networks.width + 3 * networks.layers
        per_unit += N_PLAIN + CONTROLLED
        copy = 4 * (networks.width * per_unit + CONTROLLED)
        size = learning.n_envs * (copy + ENV_BYTES)
        # Networks, targets, averages, and two moments of each weight are in a state, too.
        most = MAX_STATE_BYTES - SPARE_STATE_BYTES - 5 * networks.n_bytes
        most -= PRIORITY_BYTES * learning.buffer_size if learning.alpha > 0.0 else 0
        if size > most:
            rule = (
                f"makes environments and perturbed actors of {size / 2**20:.0f} MB with "
                f"networks.width = {networks.width} and layers = {networks.layers}; must stay "
                f"below {most // 2**20} MB"
            )
            raise InvalidInput("learning.n_envs", learning.n_envs, rule)

    def _check_noise(self) -> None:
        """Check the AR(1) noise; options are commanded as joint speeds."""
        self.exploration.check_noise(self.learning.n_envs)
        rate = self.exploration.option_rate
        if self.action.meaning == "coefficient" and rate > 0.0:
            rule = "must be 0 with action.meaning = coefficient: options command joint speeds"
            raise InvalidInput("exploration.option_rate", rate, rule)


PICK = PickPreset(networks=PickNetworks(critic="quantiles"))
"""Whole picks beside up to two people."""
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
MONITORED = PickPreset(
    name="pick-td3-monitored",
    networks=PickNetworks(critic="quantiles"),
    episode=PickEpisode(safety="ssm"),
)
"""``pick-td3`` under speed and separation monitoring; a person may touch the robot at
standstill."""
THESIS = PickPreset(
    name="pick-td3-thesis",
    learning=PickLearning(
        total_steps=4_000_000,
        n_envs=20,
        gradient_steps=20,
        buffer_size=500_000,
        batch_size=64,
        learning_starts=100,
        lr_start=1e-4,
        lr_end=1e-4,
        gamma=0.99,
        n_steps=1,
        tau=0.001,
        policy_delay=3,
        target_noise=0.2,
        target_noise_clip=0.5,
        actor_frozen_updates=0,
        progress_steps=50_000,
        progress_episodes=200,
        checkpoint_steps=50_000,
    ),
    networks=PickNetworks(actor="plain", target_value="least", width=64),
    exploration=PickExploration(noise="parameters"),
    episode=PickEpisode(
        task="reach",
        time_limit_s=20.0,
        short_limit_s=20.0,
        short_share=0.0,
        target_jitter_m=0.0,
        on_path_share=0.0,
        at_target_share=0.0,
        anywhere_share=0.0,
        curriculum_steps=500_000,
        timeout="terminates",
        observation="state",
    ),
    people=PickPeople(
        n_people=1,
        human_absent=0.0,
        human_off_task=0.0,
        human_at_rest=0.0,
        human_pace=1.0,
        human_pace_max=1.0,
    ),
    action=ActionConfig(meaning="coefficient"),
    reward=PickReward(
        c_d=0.5, c_th=0.5, c_c=1.0, c_c_end=1.0, c_step=0.02, c_v=1.0, d_v=0.1, c_s=1.0
    ),
)
"""TD3 as thesis tables 5.1 and 5.2 print it; what they leave out is the default of
Stable-Baselines 2, the library of its chapters 3 and 4 (docs/method.md 3.5).

Deviates: 20 environments are stepped together, with one update per step of each, and the bounds
of actions are never empty, so that no trajectory is unfeasible.
"""
PICK_PRESETS = (PICK, REACH_ONLY, MONITORED, THESIS)
