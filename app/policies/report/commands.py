"""Commands that measure result files."""

from app.policies.checkpoints.pretrained import SHA256
from app.policies.evaluation.registry import default_checkpoint
from app.policies.evaluation.rows import Json

_ALIASES = {sha256: alias for alias, sha256 in SHA256.items()}


def command_of(result: Json) -> str:
    """Return the command that measures a result, without options of its numbers.

    ``FILE ...`` stands for recordings, ``--checkpoint FILE`` for a policy that is not shipped.
    """
    if "command" in result:
        return str(result["command"])
    if "bench" in result:
        return f"python -m app bench {result['bench']}"
    protocol, parts = result["protocol"], []
    if result.get("settings", {}).get("motions"):
        parts.append("FILE ...")
    if (policy := result.get("checkpoint")) is not None:
        alias = _ALIASES.get(policy)
        if alias is None or alias != default_checkpoint(protocol):
            parts.append(f"--checkpoint {alias or 'FILE'}")
    return " ".join([f"python -m app evaluate {protocol}", *parts])


def training_of(result: Json, name: str, task: str = "") -> str:
    """Return the command that trained the curves of a name, with their seeds and commits.

    Args:
        task: Task of the curves; empty where the file has one task.
    """
    curves = [
        one for one in result["curves"] if one["name"] == name and one.get("task", "") == task
    ]
    preset, fields = name.partition(",")[0], curves[0].get("fields") or {}
    sets = "".join(f" --set {key}={value}" for key, value in fields.items())
    seeds = ", ".join(str(one["seed"]) for one in curves)
    commits = sorted({f"`{commit}`" for one in curves for commit in one.get("commits") or ()})
    command = f"python -m tools.docs.training_curves {preset}{sets} --seed SEED --output RUN"
    return f"{name}: `{command}`, seeds {seeds}, commits {', '.join(commits) or 'not stored'}"


def writing_command(name: str, result: Json) -> str:
    """Return the command that writes a result file.

    Args:
        name: Name of the file, without ``.json``.
    """
    command = command_of(result)
    if "command" in result:
        return command
    if "bench" not in result:
        command += f" --episodes {result['episodes']} --seed {result['seed']}"
    return f"{command} --json > docs/results/{name}.json"
