"""Collect learning curves of the reach scenario, evaluated as in docs/method.md 2.5.

    python -m tools.docs.reach.curves RUN ... [--episodes N] [--stock NAME=FILE.jsonl]

A RUN is a folder with a ``curve.jsonl``, as written by ``training_curves.py``. Each stored
policy is evaluated on 20 episodes (``--episodes``) of each of the 54 targets. ``--stock`` adds
the curve of another learner: one JSON object per line with ``env_steps``, ``cpu_s``,
``success`` and ``collision``. Writes ``docs/results/reach-curves.json`` (drawn by
``reach/plots.py``).

A curve has ``played``, the greedy evaluations during training on the goals of the training, and
``targets``, one point per stored policy.
"""

from pathlib import Path

from app.policies.evaluation.reach.bench import ReachBench
from tools.docs.learning_curves import collect, lines, policies
from tools.docs.results import RESULTS, Json

SEED = 77
"""Seed of the episodes; not used in training."""
PER_TARGET = 20
"""Episodes of each target (docs/method.md 2.5)."""
ENDS = ("success", "collision", "timeout")


def curve_of_run(folder: Path, per_target: int | None) -> Json:
    """Return the curve of a training: its points, and its policies on all targets."""
    points, n = lines(folder / "curve.jsonl"), per_target or PER_TARGET
    spent = {one["step"]: one["cpu_s"] for one in points}
    targets, commits = [], list[str]()
    for checkpoint in policies(folder):
        commits = checkpoint.manifest.get("commits", [])
        rates = ReachBench(checkpoint, SEED).on_targets(n).rates()
        step = checkpoint.manifest["step"]
        ends = {end: rates[end]["mean"] for end in ENDS}
        targets.append({"step": step, "cpu_s": spent.get(step), **ends})
    return {
        "name": points[0]["preset"],
        "seed": points[0]["seed"],
        "commits": commits,
        "episodes_per_target": n,
        "played": [
            {key: one[key] for key in ("step", "cpu_s", *ENDS)}
            for one in points
            if one["collision"] is not None
        ],
        "targets": [one for one in targets if one["cpu_s"] is not None],
    }


def curve_of_stock(name: str, path: Path) -> Json:
    """Return the curve of another learner; its points are its own evaluations."""
    points = [
        {
            "step": one["env_steps"],
            "cpu_s": one["cpu_s"],
            "success": one["success"],
            "collision": one["collision"],
            "timeout": 1.0 - one["success"] - one["collision"],
        }
        for one in lines(path)
    ]
    return {"name": name, "seed": None, "played": points, "targets": []}


if __name__ == "__main__":
    collect(
        "Collect learning curves of reaching.",
        results=RESULTS / "reach-curves.json",
        command="python -m tools.docs.reach.curves RUN ...",
        seed=SEED,
        of_run=curve_of_run,
        of_stock=curve_of_stock,
    )
