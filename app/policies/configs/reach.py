"""Training configurations of the reach scenario: TD3 and DDPG (docs/method.md 2.2, 2.3, 2.5).

Deviates: values that learn in minutes replace those of thesis table 4.2 (many parallel
environments, speed targets, features, reward for progress). ``reach-ddpg-thesis`` is the table,
``reach-ddpg-authors`` the run of its authors.
"""

from typing import Literal, Self

from pydantic import model_validator

from app.errors import InvalidInput
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
from app.sim.reach.batch import GoalRule, LimitRule, StartRule, ViewName
from app.sim.reach.goal_sets import MOST_HALTON, N_HALTON


class ReachLearning(TD3Learning):
    """TD3 whose learning curve is measured in episodes of its own."""

    progress_episodes: Whole = number(
        1_080, 1, 10_000, "episodes", "Curve episodes: greedy episodes behind a point"
    )


class ReachNetworks(ActorCriticNetworks):
    """Kinds of actor and critics."""

    actor: Literal["residual", "plain", "ddpg"] = choice(
        "residual", "Actor: residual to the nominal controller, plain, or Glorot-initialised"
    )
    critic: Literal["mean", "quantiles", "ddpg"] = choice(
        "mean",
        "Critic: expected return, quantiles of it (TQC), or DDPG's of Stable-Baselines 2",
    )
    normalisation: Literal["none", "running"] = choice(
        "none", "Observations of ddpg networks: as they are, or by running mean and deviation"
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        """Check the kinds of network against each other."""
        if self.normalisation == "running" and (self.actor, self.critic) != ("ddpg", "ddpg"):
            rule = "needs actor = ddpg and critic = ddpg"
            raise InvalidInput("networks.normalisation", self.normalisation, rule)
        if self.critic == "ddpg" and self.layers < 2:
            rule = "must be at least 2 with critic = ddpg, whose second layer takes the action"
            raise InvalidInput("networks.layers", self.layers, rule)
        return self


class ReachExploration(NoiseExploration):
    """Exploration noise."""

    noise: Literal["ar1", "ou"] = choice(
        "ar1", "Noise: AR(1) with a scale per environment, or Ornstein-Uhlenbeck"
    )
    ou_theta: float = number(0.3, 0.0, 1.0, "", "Ornstein-Uhlenbeck rate θ")
    ou_sigma: float = number(0.15, 0.0, 2.0, "", "Ornstein-Uhlenbeck scale σ")
    ou_dt: float = number(0.01, 1e-4, 1.0, "", "Ornstein-Uhlenbeck step per control period")


class ReachEpisode(FieldGroup):
    """Starts, ends and observations of episodes."""

    time_limit_s: float = number(5.0, 1.0, 60.0, "s", "Time limit")
    goals: GoalRule = choice("grid", "Set of the goals")
    n_halton: Whole = number(N_HALTON, 8, MOST_HALTON, "", "Halton points: for goals = halton")
    start: StartRule = choice("clearance", "Start positions of people")
    start_clearance_m: float = number(
        0.05, 0.0, 1.0, "m", "Start clearance: least distance of robot and people"
    )
    collision: Literal["terminates", "continues", "blocks"] = choice(
        "terminates", "Collision: terminates the episode, continues it, or blocks the arm"
    )
    timeout: Literal["as-observed", "terminates"] = choice(
        "as-observed", "Time-out: truncates an episode if its time is not observed, or ends it"
    )
    limits: LimitRule = choice("cell", "Joint limits: of the cell, or of the authors' code")
    safety: Literal["none", "ssm"] = choice(
        "none", "Safety layer: none, or speed and separation monitoring"
    )
    observation: ViewName = choice(
        "forecast", "Observation: the plain state, features, or also motion predictions"
    )


class ReachPeople(FieldGroup):
    """Pedestrians in the cell."""

    n_people: Whole = number(1, 0, 4, "", "People")
    count: Literal["exact", "up-to"] = choice(
        "exact", "Count: exact, or 1 to that many people in equal shares of environments"
    )


class ReachReward(FieldGroup):
    """Coefficients of the reward."""

    c_d: float = number(0.0, 0.0, 10.0, "1/m", "Distance cost c_d")
    c_p: float = number(1.0, 0.0, 10.0, "1/m", "Progress reward weight c_p")
    c_a: float = number(0.0, 0.0, 10.0, "s²/rad", "Acceleration cost c_a")
    c_step: float = number(0.003, 0.0, 1.0, "", "Time cost c_step: per control period")
    c_c: float = number(4.0, 0.0, 100.0, "", "Collision cost c_c")
    c_s: float = number(4.0, 0.0, 100.0, "", "Success bonus c_s")
    c_u: float = number(
        0.0, 0.0, 10.0, "", "Command cost c_u: of the norm of the action; collision = blocks"
    )
    bonus: Literal["added", "alone"] = choice(
        "added", "Success bonus: added to the other terms, or alone; collision = blocks"
    )
    c_o: float = number(
        0.0, 0.0, 10.0, "", "Stop cost c_o: per control period stopped by the safety layer"
    )


class ReachPreset(TrainingConfig):
    """TD3 or DDPG on the reach scenario; the defaults are those of ``reach-td3``."""

    name: str = "reach-td3"
    cell: CellName = "shared-workspace"
    learning: ReachLearning = ReachLearning(
        total_steps=7_680_000, ema=0.999, progress_steps=256_000, checkpoint_steps=1_280_000
    )
    networks: ReachNetworks = ReachNetworks()
    exploration: ReachExploration = ReachExploration(sigma_max=0.6)
    episode: ReachEpisode = ReachEpisode()
    people: ReachPeople = ReachPeople()
    action: ActionConfig = ActionConfig()
    reward: ReachReward = ReachReward()

    @model_validator(mode="after")
    def _check(self) -> Self:
        """Check the groups against each other."""
        episode, people, actor = self.episode, self.people, self.networks.actor
        if actor == "residual" and episode.observation == "state":
            rule = "must be plain or ddpg with observation = state"
            raise InvalidInput("networks.actor", actor, rule)
        if actor == "ddpg" and episode.observation == "people-set":
            rule = "must be residual or plain with observation = people-set"
            raise InvalidInput("networks.actor", actor, rule)
        if actor == "residual" and self.action.meaning == "coefficient":
            rule = "must be speed with actor = residual, which adds to a joint speed"
            raise InvalidInput("action.meaning", self.action.meaning, rule)
        if episode.safety == "ssm" and (
            episode.collision != "terminates" or people.n_people == 0
        ):
            rule = "needs n_people above 0 and collision = terminates"
            raise InvalidInput("episode.safety", episode.safety, rule)
        self._check_blocked()
        if self.exploration.noise == "ar1":
            self.exploration.check_noise(self.learning.n_envs)
        if people.count == "up-to" and (
            not 1 <= people.n_people <= self.learning.n_envs or episode.safety != "none"
        ):
            rule = "needs 1 to n_envs people and safety = none"
            raise InvalidInput("people.count", people.count, rule)
        return self

    def _check_blocked(self) -> None:
        """Check the reward and the people of an arm that contacts block."""
        reward, episode = self.reward, self.episode
        blocks = episode.collision == "blocks"
        if blocks and (reward.c_p, reward.c_a, reward.c_step, reward.c_o) != (0.0,) * 4:
            rule = "needs c_p = c_a = c_step = c_o = 0"
            raise InvalidInput("episode.collision", episode.collision, rule)
        if blocks and self.people.count == "up-to":
            raise InvalidInput("people.count", "up-to", "needs another collision than blocks")
        if reward.c_o > 0.0 and episode.safety == "none":
            raise InvalidInput("reward.c_o", reward.c_o, "needs safety = ssm")
        if not blocks and reward.c_u > 0.0:
            raise InvalidInput("reward.c_u", reward.c_u, "needs collision = blocks")
        if not blocks and reward.bonus != "added":
            raise InvalidInput("reward.bonus", reward.bonus, "needs collision = blocks")


_AUTHORS_LEARNING = ReachLearning(
    total_steps=4_998_000,
    n_envs=60,
    buffer_size=200_000,
    batch_size=128,
    learning_starts=120,
    lr_start=1e-4,
    lr_end=1e-4,
    actor_lr_ratio=10.0,
    n_steps=1,
    tau=0.001,
    target_noise=0.0,
    target_noise_clip=0.0,
    actor_frozen_updates=0,
    progress_steps=49_980,
    checkpoint_steps=499_800,
)
AUTHORS = ReachPreset(
    name="reach-ddpg-authors",
    learning=_AUTHORS_LEARNING,
    networks=ReachNetworks(
        width=400,
        layers=10,
        actor="ddpg",
        critic="ddpg",
        normalisation="running",
        critic_norm="none",
        n_critics=1,
    ),
    exploration=ReachExploration(noise="ou"),
    episode=ReachEpisode(
        goals="in-turn",
        start="authors",
        collision="blocks",
        timeout="terminates",
        limits="authors",
        observation="state",
    ),
    reward=ReachReward(
        c_d=1.0, c_p=0.0, c_step=0.0, c_c=5.0, c_s=20.0, c_u=0.01, bonus="alone"
    ),
)
"""DDPG as the authors ran it: their public code, its parameters and the defaults of
Stable-Baselines 2 (docs/method.md 2.5).

Deviates: 60 environments are stepped together, with one update per step of all, in place of one
environment with an update every 60 steps; intervals are multiples of 60 for that reason. The
arm is blocked by a rule in place of contact forces.
"""

THESIS = AUTHORS.model_copy(
    update={
        "name": "reach-ddpg-thesis",
        "learning": ReachLearning(
            **{**_AUTHORS_LEARNING.model_dump(), "total_steps": 3_998_400, "alpha": 0.6}
        ),
        "episode": AUTHORS.episode.model_copy(update={"start": "uniform"}),
        "reward": ReachReward(c_d=1.0, c_p=0.0, c_step=0.0, c_c=5.0, c_s=20.0, c_u=0.1),
    }
)
"""DDPG as thesis tables 4.1 and 4.2 print it; values that they do not print are those of
``reach-ddpg-authors``. Differences: prioritised replay (exponents of Schaul et al. 2016), an
action cost of 0.1, a success bonus beside the other terms (4.28), the printed walk (4.1), and
4e6 steps."""

MONITORED = ReachPreset(
    name="reach-td3-monitored",
    episode=ReachEpisode(safety="ssm", time_limit_s=10.0, start_clearance_m=0.8),
    reward=ReachReward(c_o=0.02),
)
"""``reach-td3`` under speed and separation monitoring, with twice the time. People start so far
away that the robot is allowed to move."""

PEOPLE_SET = ReachPreset(
    name="reach-td3-people-set",
    episode=ReachEpisode(observation="people-set"),
    people=ReachPeople(n_people=4, count="up-to"),
)
"""``reach-td3`` beside one to four people, observed as a set."""

REACH_PRESETS = (ReachPreset(), MONITORED, PEOPLE_SET, AUTHORS, THESIS)
"""All presets of the scenario."""
