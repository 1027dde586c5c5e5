"""Collect learning curves of the sorting task, evaluated as in docs/method.md 1.5.

    python -m tools.docs.sorting.curves RUN ... [--stock CELL=FILE.jsonl] [--episodes N]

A RUN is a folder written by ``training_curves.py``. Each stored policy is evaluated greedily
and without planner fallback on each pair (K_E, K_G): 500 episodes per pair on e0, 100 on e1,
or ``--episodes``. ``--stock`` adds the output of ``tests/benchmarks/peers/stock_dqn.py``.
Writes ``docs/results/sorting-curves.json`` (drawn by ``sorting/plots.py``).

A curve has ``played``, the greedy evaluations during training, and ``pairs``, one point per
stored policy.
"""

from pathlib import Path

from app.policies.checkpoints.trained_cell import cell_of
from app.policies.configs import presets
from app.policies.evaluation.sorting.episodes import Values, greedy, joined, run_episodes
from app.policies.evaluation.sorting.grid import SMALL, grid_batches
from app.policies.inference.sorting_policy import SortingPolicy
from app.sim.core.arrays import Vec
from app.sim.sorting.batch import fail_of
from app.sim.sorting.state import SortingShape
from tools.docs.learning_curves import collect, lines, policies
from tools.docs.results import RESULTS, Json

SEED = 77
"""Seed of the episodes; not used in training."""
STOCK = "stock Stable-Baselines3 DQN"


def curve_episodes(shape: SortingShape) -> int:
    """Return the thesis' number of episodes per pair for one point of its curves."""
    return 500 if shape.n_slots <= SMALL else 100


def curve_point(
    values: Values,
    shape: SortingShape,
    fail: Vec,
    episodes_per_pair: int,
    seed: int,
) -> dict[str, float]:
    """Return success rate, mean return and its standard deviation, all pairs alike.

    Returns are not discounted.

    Args:
        values: Q of every move, from observations.
        shape: Size of the task.
        fail: Failure probabilities of the clutter slots, shape (K,).
        episodes_per_pair: Episodes of each pair; :func:`curve_episodes` gives the thesis'.
        seed: Seed of the episodes.
    """
    batches = grid_batches(shape, fail, episodes_per_pair, seed, 0.0)
    found = joined([run_episodes(batch, greedy(values)) for batch in batches])
    return {
        "success": float(found.success.mean()),
        "mean_return": float(found.rewards.mean()),
        "return_sd": float(found.rewards.std()),
    }


def curve_of_run(folder: Path, episodes: int | None) -> Json:
    """Return the curve of a training: its points, and its policies on all pairs."""
    points = lines(folder / "curve.jsonl")
    spent = {one["step"]: one["cpu_s"] for one in points}
    first = points[0]
    cell = presets.get(first["preset"]).cell
    named = {"task": cell, "name": first["preset"], "seed": first.get("seed", 1)}
    pairs = []
    for checkpoint in policies(folder):
        manifest = checkpoint.manifest
        policy, fail = SortingPolicy(checkpoint), fail_of(cell_of(manifest))
        n = episodes or curve_episodes(policy.shape)
        point = curve_point(policy.values, policy.shape, fail, n, SEED)
        named = {
            "task": manifest["cell"],
            "name": manifest["preset"]["name"],
            "seed": manifest["seed"],
            "commits": manifest.get("commits", []),
            "episodes_per_pair": n,
        }
        step = manifest["step"]
        pairs.append({"step": step, "cpu_s": spent.get(step), **point})
    played = [_point(one, one["step"], one["reward"]) for one in points]
    return {**named, "played": played, "pairs": pairs}


def curve_of_stock(cell: str, path: Path) -> Json:
    """Return the curve of the stock learner; its points are its own evaluations."""
    points = [_point(one, one["env_steps"], one["return"]) for one in lines(path)]
    return {"task": cell, "name": STOCK, "seed": None, "played": points, "pairs": []}


def _point(one: Json, step: int, mean_return: float) -> Json:
    return {
        "step": step,
        "cpu_s": one["cpu_s"],
        "success": one["success"],
        "mean_return": mean_return,
    }


if __name__ == "__main__":
    collect(
        "Collect learning curves of sorting.",
        results=RESULTS / "sorting-curves.json",
        command="python -m tools.docs.sorting.curves RUN ...",
        seed=SEED,
        of_run=curve_of_run,
        of_stock=curve_of_stock,
    )
