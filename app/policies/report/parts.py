"""Parts of the report: tables and figures of the thesis, and the places of our numbers."""

from dataclasses import dataclass
from typing import Any

from app.policies.configs import presets

Json = dict[str, Any]
NONE = ""
"""Where a recipe or a best policy has nothing to compare."""


@dataclass(frozen=True, slots=True)
class StoredValue:
    """A number of a result file.

    Args:
        file: Name of the file without ``.json``.
        row: Name of its row, or of a paired difference.
        key: Key in the row: a rate, a quantity with its interval, or a number.
        unit: Unit of a quantity; empty for a rate.
    """

    file: str
    row: str
    key: str
    unit: str = ""

    def value(self, found: Json) -> str | None:
        """Return the number as text; None where the row or the number is missing."""
        paired = [one for one in found.get("paired", ()) if isinstance(one, dict)]
        listed = [*found.get("results", ()), *paired]
        rows = {one["name"]: one for one in reversed(listed)}
        value = rows.get(self.row, {}).get(self.key)
        if isinstance(value, dict) and not self.unit:
            mean, low, high = (100.0 * value[key] for key in ("mean", "low", "high"))
            return f"{mean:.2f} % ({low:.2f}-{high:.2f})"
        if isinstance(value, dict) and "sd" not in value:
            places = 1 if abs(value["mean"]) >= 10.0 else 2
            mean, low, high = (f"{value[key]:.{places}f}" for key in ("mean", "low", "high"))
            return f"{mean} ({low} to {high}) {self.unit}"
        if isinstance(value, dict):
            return f"{value['mean']:.2f} ± {value['sd']:.2f} {self.unit}"
        return None if value is None else f"{value:.3g} {self.unit}".rstrip()


STANDING_STILL = "standing_still"
"""Key of the return of standing still in the episodes of a curve."""


@dataclass(frozen=True, slots=True)
class Curve(StoredValue):
    """The last point of a learning curve.

    Args:
        file: Name of the file without ``.json``.
        row: Name of the preset.
        key: Key of the point.
        task: Task of the curve; empty where the file has one task.
    """

    task: str = ""

    def value(self, found: Json) -> str | None:
        """Return the mean over the seeds; None without such a curve."""
        curves = [
            one
            for one in found.get("curves", ())
            if one["name"] == self.row and one.get("task", "") == self.task
        ]
        if self.key == STANDING_STILL:
            still = [one[self.key] for one in curves if self.key in one]
            return f"{still[0]:.2f}" if still else None
        points = [one.get("pairs") or one.get("targets") or one["played"] for one in curves]
        ends = [point[-1] for point in points if point and point[-1].get(self.key) is not None]
        if not ends:
            return None
        mean = sum(end[self.key] for end in ends) / len(ends)
        steps, seeds = max(end["step"] for end in ends), len(ends)
        text = f"{mean:.2f}" if self.unit else f"{100.0 * mean:.1f} %"
        return f"{text} after {steps / 1e6:.2f} M steps, {seeds} seed{'s'[: seeds > 1]}"


@dataclass(frozen=True, slots=True)
class Config:
    """A number of a preset.

    Args:
        preset: Its name.
        path: Group and field: ``"learning.gamma"``.
        factor: Factor on it.
    """

    preset: str
    path: str
    factor: float = 1.0

    def value(self) -> float:
        """Return the number."""
        value: Any = presets.get(self.preset)
        for name in self.path.split("."):
            value = getattr(value, name)
        return float(value) * self.factor


@dataclass(frozen=True, slots=True)
class Measure:
    """One line of a table."""

    name: str
    """What is measured."""
    thesis: str
    """Number of the thesis."""
    recipe: StoredValue | Config | str = NONE
    """Number of its recipe on Tandem's simulator."""
    best: StoredValue | Config | str = NONE
    """Number of Tandem's best policy."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Item:
    """A table or a figure of the thesis."""

    chapter: str
    """Heading of its chapter."""
    title: str
    """Its number and content."""
    measures: tuple[Measure, ...] = ()
    """Lines of the table."""
    images: tuple[tuple[str, str], ...] = ()
    """Images in ``docs/img`` and their descriptions."""
    agreement: str
    """Whether and how both agree."""
    command: str = ""
    """Command that measures what has no result file."""


Line = tuple[str, str, str] | tuple[str, str, str, float]
TRAIN = "python -m tools.docs.training_curves {preset} --seed 1 --output RUN"
COLLECT = " && python -m tools.docs.thesis_curves {file} RUN"


def trained(preset: str, file: str) -> str:
    """Return the command that trains a preset and writes its curve to a result file."""
    return (TRAIN + COLLECT).format(preset=preset, file=file)


def configured(preset: str, *lines: Line) -> tuple[Measure, ...]:
    """Return lines of hyper-parameters: name, number of the thesis, path, and factor."""
    return tuple(Measure(line[0], line[1], Config(preset, *line[2:])) for line in lines)


def rates(
    file: str, row: str, label: str, thesis: tuple[str, str, str], recipe: StoredValue | str
) -> tuple[Measure, ...]:
    """Return success, collision and timeout of a row; the recipe's success."""
    ends = zip(("success", "collision", "timeout"), thesis, strict=True)
    return tuple(
        Measure(
            f"{label}: {end}",
            number,
            recipe if end == "success" else "",
            StoredValue(file, row, end),
        )
        for end, number in ends
    )
