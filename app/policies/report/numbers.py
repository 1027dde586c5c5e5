"""Numbers of result files, presets and settings as text."""

from typing import Any

from app.policies.configs import presets
from app.policies.evaluation.rows import Json
from app.sim.cells.cell import load_cell
from app.sim.people.pedestrian import PedestrianSettings
from app.sim.pick.kernels.episode import SUCCESS_TILT
from app.sim.scenario.kernels.episode import SUCCESS_DISTANCE


def stored_value(found: Json, row: str, key: str, unit: str = "") -> str | None:
    """Return a number of a result; None where the row or the number is missing.

    Args:
        found: Content of the result file.
        row: Name of its row, or of a paired difference.
        key: Key in the row: a rate, a quantity with its interval, or a number.
        unit: Unit of a quantity; empty for a rate.
    """
    paired = [one for one in found.get("paired", ()) if isinstance(one, dict)]
    listed = [*found.get("results", ()), *paired]
    rows = {one["name"]: one for one in reversed(listed)}
    value = rows.get(row, {}).get(key)
    if isinstance(value, dict) and not {"low", "sd"} & value.keys():
        value = value["mean"]  # of a single episode
    if isinstance(value, dict) and not unit:
        mean, low, high = (100.0 * value[key] for key in ("mean", "low", "high"))
        to = "-" if low >= 0.0 else " to "
        return f"{mean:.2f} % ({low:.2f}{to}{high:.2f})"
    if isinstance(value, dict) and "sd" not in value:
        places = 1 if abs(value["mean"]) >= 10.0 else 2
        mean, low, high = (f"{value[key]:.{places}f}" for key in ("mean", "low", "high"))
        return f"{mean} ({low} to {high}) {unit}"
    if isinstance(value, dict):
        return f"{value['mean']:.2f} ± {value['sd']:.2f} {unit}"
    return None if value is None else f"{value:.3g} {unit}".rstrip()


def curve_end(found: Json, preset: str, key: str, unit: str = "", task: str = "") -> str | None:
    """Return the last point of learning curves, as the mean over seeds; None without one.

    Curves of different lengths are compared at the end of the shortest. A training that was
    stopped because its policy had ceased to change counts as if it had gone on, but for the
    processor time.

    Args:
        found: Content of the result file.
        key: Key of the point; ``standing_still`` is the return of a robot that does not move.
        unit: Unit of a quantity; empty for a rate.
        task: Task of the curve; empty where the file has one task.
    """
    curves = [
        one
        for one in found.get("curves", ())
        if one["name"] == preset and one.get("task", "") == task
    ]
    if key == "standing_still":
        still = [one[key] for one in curves if key in one]
        return f"{still[0]:.2f}" if still else None
    points = [one.get("pairs") or one.get("targets") or one["played"] for one in curves]
    points = [point for point in points if point and point[-1].get(key) is not None]
    if not points:
        return None
    lengths = [point[-1]["step"] for point in points]
    learning = [n for n, point in zip(lengths, points, strict=True) if not _has_ceased(point)]
    steps = min(learning or lengths)
    if key == "cpu_s":
        points = [point for point in points if point[-1]["step"] >= steps]
    ends = [[one for one in point if one["step"] <= steps][-1] for point in points]
    seeds, mean = len(ends), sum(end[key] for end in ends) / len(ends)
    text = f"{mean:.2f}" if unit else f"{100.0 * mean:.1f} %"
    return f"{text} after {steps / 1e6:.2f} M steps, {seeds} seed{'s'[: seeds > 1]}"


def _has_ceased(points: list[Json]) -> bool:
    """Return whether the last two points of a curve have the same episodes to all digits."""
    if len(points) < 2 or "reward" not in points[-1]:
        return False
    keys = "success", "collision", "timeout", "reward"
    before, last = ([point.get(key) for key in keys] for point in points[-2:])
    return before == last


def preset_value(preset: str, path: str, factor: str = "1") -> str:
    """Return a field of a preset.

    Args:
        path: Group and field: ``"learning.gamma"``.
        factor: Factor on a number.
    """
    value: Any = presets.get(preset)
    for name in path.split("."):
        value = getattr(value, name)
    return value if isinstance(value, str) else f"{float(value) * float(factor):,.10g}"


def setting(preset: str, name: str) -> str:
    """Return a number of a preset's scenario [Hz, m, rad, rad/s] or pedestrians [m/s, m]."""
    robot, walk = load_cell(presets.get(preset).cell).robot, PedestrianSettings()
    numbers = {
        "control_rate": 1.0 / robot.dt,
        "success_distance": SUCCESS_DISTANCE,
        "success_tilt": SUCCESS_TILT,
        "joint_speed": max(robot.qd_max),
    }
    return f"{numbers.get(name) or getattr(walk, name):g}"
