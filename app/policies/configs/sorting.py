"""The presets of the sorting task: every number of a training, frozen (METHOD 1.4)."""

from dataclasses import dataclass

from app.errors import InvalidInput, digits
from app.policies.configs.fields import check_learning, check_rounds, choice, number
from app.sim.sorting.batch import SortingSettings
from app.sim.sorting.kernels.reward import SortingWeights

NETWORKS = ("shared", "printed")


@dataclass(frozen=True, slots=True, kw_only=True)
class SortingPreset:
    """DQN on the sorting task: all that a training run depends on besides its seed.

    The defaults are those of ``sorting-e0-dqn``. Double, dueling and prioritised as in the
    source. Deviates: network, mask, n-step returns, disturbed starts, people in the training
    and the advice of the exact planner are ours; the source's recipe has its own presets.
    """

    name: str = "sorting-e0-dqn"
    """Name in requests."""
    cell: str = "sorting-e0"
    """Work cell trained in."""

    total_steps: int = number(
        1_280_000, 1_000, 100_000_000, "env steps", "length of the training"
    )
    n_envs: int = number(128, 1, 4096, "", "tasks stepped together")
    gradient_steps: int = number(1, 1, 1024, "updates", "updates per step of all tasks")
    buffer_size: int = number(
        200_000, 2_000, 2_000_000, "transitions", "size of the replay memory"
    )
    batch_size: int = number(256, 16, 4096, "transitions", "minibatch of an update")
    learning_starts: int = number(
        6_400, 0, 1_000_000, "env steps", "steps before the first update"
    )
    lr_start: float = number(1e-3, 1e-6, 1e-2, "", "learning rate at the start")
    lr_end: float = number(2e-5, 1e-7, 1e-2, "", "learning rate at the end")
    gamma: float = number(0.95, 0.5, 0.9999, "per attempt", "discount")
    n_steps: int = number(3, 1, 20, "attempts", "length of n-step returns")
    target_every: int = number(
        200, 1, 100_000, "updates", "updates between two copies into the target network"
    )
    alpha: float = number(0.6, 0.0, 1.0, "", "exponent of the priorities; 0 draws evenly")
    beta: float = number(0.4, 0.0, 1.0, "", "exponent of the importance weights at the start")
    max_grad_norm: float = number(10.0, 0.01, 1000.0, "", "greatest norm of a gradient")

    network: str = choice(
        "shared",
        NETWORKS,
        "weights shared over towers, valid moves only; or the source's two plain layers",
    )
    width: int = number(128, 16, 1024, "units", "width of the hidden layers")
    eps_start: float = number(1.0, 0.0, 1.0, "", "share of random moves at the start")
    eps_end: float = number(0.02, 0.0, 1.0, "", "share of random moves in the end")
    eps_share: float = number(
        0.2, 0.001, 1.0, "", "share of the training over which it falls, N_t"
    )

    solved_episodes: float = number(
        0.3, 0.0, 1.0, "", "share of episodes that start partly solved at first, e_s"
    )
    solved_share: float = number(
        0.8, 0.0, 1.0, "", "share of their goal that is done at first, g_s"
    )
    even_share: float = number(
        0.5, 0.0, 1.0, "", "share of episodes whose sizes are drawn evenly, not triangular"
    )
    disturbed_share: float = number(
        0.6, 0.0, 1.0, "", "share of episodes with junk on towers and goals partly built"
    )
    human_rate: float = number(
        0.02, 0.0, 1.0, "per attempt", "how often a person adds, removes, moves or asks anew"
    )
    localisation_rate: float = number(
        0.0, 0.0, 1.0, "per pick", "how often another object is moved than was meant"
    )
    random_map_share: float = number(
        0.3, 0.0, 1.0, "", "share of episodes with a failure map drawn at random"
    )
    horizon_factor: float = number(
        4.0, 1.0, 100.0, "attempts per cell", "length at which episodes are cut off"
    )

    advice_share: float = number(
        0.25,
        0.0,
        1.0,
        "",
        "share of a minibatch in which the exact planner marks the best moves",
    )
    advice_margin: float = number(
        0.05, 0.0, 10.0, "", "by how much one of them shall be worth more than others (DQfD)"
    )
    advice_weight: float = number(1.0, 0.0, 100.0, "", "weight of that in the loss")

    c_move: float = number(0.05, 0.0, 10.0, "", "cost of an attempt")
    c_empty: float = number(0.3, 0.0, 10.0, "", "cost of picking where nothing is")
    c_stuck: float = number(0.3, 0.0, 10.0, "", "cost of putting an object back")
    c_fail: float = number(0.01, 0.0, 10.0, "", "cost of a failed pick")
    c_back: float = number(0.01, 0.0, 10.0, "", "cost of a move from a tower to the clutter")
    c_distance: float = number(
        0.01, 0.0, 10.0, "", "cost per attempt, of all levels differing from the goal"
    )
    c_success: float = number(1.0, 0.0, 100.0, "", "bonus of a goal that is met")

    progress_steps: int = number(
        12_800, 1, 10_000_000, "env steps", "steps between two points of the curve"
    )
    checkpoint_steps: int = number(
        256_000, 1, 10_000_000, "env steps", "steps between two checkpoints"
    )
    progress_episodes: int = number(
        500, 10, 100_000, "episodes", "greedy episodes behind a point of the curve"
    )

    @property
    def weights(self) -> SortingWeights:
        """Coefficients of the reward."""
        return SortingWeights(
            move=self.c_move,
            empty=self.c_empty,
            stuck=self.c_stuck,
            fail=self.c_fail,
            back=self.c_back,
            distance=self.c_distance,
            success=self.c_success,
        )

    def settings(self, done: float) -> SortingSettings:
        """Return the task's settings; the curriculum fades linearly (METHOD 1.4).

        Args:
            done: How far the training is, from 0 to 1.
        """
        left = max(0.0, 1.0 - done)
        return SortingSettings(
            horizon_factor=self.horizon_factor,
            disturbed_share=self.disturbed_share,
            solved_episodes=left * self.solved_episodes,
            solved_share=left * self.solved_share,
            even_share=self.even_share,
            human_rate=self.human_rate,
            localisation_rate=self.localisation_rate,
            random_map_share=self.random_map_share,
            weights=self.weights,
        )

    def check(self) -> None:
        """Check the fields against each other.

        Raises:
            InvalidInput: Two of them do not go together.
        """
        check_rounds(self.total_steps, self.progress_steps, self.checkpoint_steps, self.n_envs)
        check_learning(self.learning_starts, self.total_steps, self.buffer_size, self.n_envs)
        if self.solved_episodes + self.disturbed_share > 1.0:
            most = 1.0 - self.disturbed_share
            rule = f"must not exceed 1 - disturbed_share = {digits(most)}"
            raise InvalidInput("overrides.solved_episodes", self.solved_episodes, rule)


def _printed(name: str, cell: str, total_steps: int) -> SortingPreset:
    """Return table 3.1.

    What it does not print: an update every fourth attempt, and a reward in which parking and
    failures cost as much as a move.
    """
    return SortingPreset(
        name=name,
        cell=cell,
        total_steps=total_steps,
        n_envs=40,
        gradient_steps=10,
        buffer_size=100_000,
        batch_size=256,
        learning_starts=2_000,
        lr_start=1e-4,
        lr_end=1e-4,
        gamma=0.92,
        n_steps=1,
        target_every=500,
        network="printed",
        width=128,
        advice_share=0.0,
        eps_start=1.0,
        eps_end=0.05,
        eps_share=1.0,
        c_fail=0.05,
        c_back=0.05,
        c_distance=0.1,
        solved_episodes=0.5,
        even_share=0.0,
        disturbed_share=0.0,
        human_rate=0.0,
        random_map_share=0.0,
        progress_steps=50_000,
        checkpoint_steps=250_000,
    )


SORTING_PRESETS = (
    SortingPreset(),
    SortingPreset(
        name="sorting-e1-dqn",
        cell="sorting-e1",
        total_steps=2_048_000,
        advice_share=0.5,
        advice_margin=0.1,
    ),
    SortingPreset(
        name="sorting-e1-dqn-pure",
        cell="sorting-e1",
        total_steps=2_048_000,
        batch_size=384,
        width=192,
        solved_episodes=0.2,
        disturbed_share=0.7,
        human_rate=0.0,
        advice_share=0.0,
    ),
    _printed("sorting-e0-thesis", "sorting-e0", 2_000_000),
    _printed("sorting-e1-thesis", "sorting-e1", 8_000_000),
)
"""The presets of the sorting task."""
