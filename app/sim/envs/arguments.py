"""Validation of the arguments of environments, which may come from configurations of users."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from app.errors import InvalidInput
from app.sim.cells.cell import Cell, cell_names, load_cell
from app.sim.pick.batch import PickSettings
from app.sim.reach.batch import ReachSettings
from app.sim.scene.scene import HUMAN_KINDS, HumanKind

Settings = TypeVar("Settings")
WithPeople = TypeVar("WithPeople", PickSettings, ReachSettings)

RENDER_MODES = ("rgb_array",)
MAX_ENVS = 2**31 - 1
"""Greatest number of an environment."""


def cell_of(cell: str | Cell) -> Cell:
    """Return a work cell, given by name or directly.

    Raises:
        NotFound: No cell of that name is shipped.
        InvalidInput: It is neither a name nor a cell.
    """
    if isinstance(cell, Cell):
        return cell
    if not isinstance(cell, str):
        rule = "must be the name of a shipped work cell, or a Cell"
        raise InvalidInput("cell", type(cell).__name__, rule, cell_names())
    return load_cell(cell)


def settings_of(settings: Settings | None, default: Settings) -> Settings:
    """Return stated settings, or the default ones if None.

    Raises:
        InvalidInput: They are of another type than the default ones.
    """
    if settings is None:
        return default
    if not isinstance(settings, type(default)):
        rule = f"must be {type(default).__name__} or None"
        raise InvalidInput("settings", type(settings).__name__, rule)
    return settings


def settings_with(
    settings: WithPeople | None, default: WithPeople, people: Sequence[HumanKind] | None
) -> WithPeople:
    """Return settings as :func:`settings_of`, with other people unless ``people`` is None.

    Raises:
        InvalidInput: The settings are of another type, or the people are no list of kinds.
    """
    chosen = settings_of(settings, default)
    if people is None:
        return chosen
    if isinstance(people, str) or not isinstance(people, Sequence):
        raise InvalidInput("people", people, "must be a list of kinds of people", HUMAN_KINDS)
    return replace(chosen, people=tuple(people))


def env_number(field: str, value: int, least: int = 0) -> int:
    """Return the number of an environment, or a number of environments.

    Raises:
        InvalidInput: It is not a whole number from ``least`` to MAX_ENVS.
    """
    is_whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not is_whole or not least <= value <= MAX_ENVS:
        raise InvalidInput(field, value, f"must be a whole number in [{least}, 2^31)")
    return int(value)


def options_of(options: Any, known: Sequence[str]) -> Mapping[str, Any]:
    """Return the options of a reset; empty if None.

    Raises:
        InvalidInput: They are no mapping, or hold an unknown one.
    """
    if options is None:
        return {}
    if not isinstance(options, Mapping):
        rule = "must be a mapping of options or None"
        raise InvalidInput("options", type(options).__name__, rule, tuple(known))
    for name in options:
        if name not in known:
            raise InvalidInput("options", name, "must be options of reset()", tuple(known))
    return options


def check_render_mode(mode: str | None) -> str | None:
    """Return a render mode that exists, or None for none.

    Raises:
        InvalidInput: There is no such mode.
    """
    if mode is not None and mode not in RENDER_MODES:
        raise InvalidInput("render_mode", mode, "must be a render mode or None", RENDER_MODES)
    return mode


def action_array(given: ArrayLike) -> NDArray[Any]:
    """Return actions as an array of real numbers.

    Raises:
        InvalidInput: They are text, complex or other objects, or rows of several lengths.
    """
    try:
        act = np.asarray(given)
    except ValueError:
        raise InvalidInput("act", "rows of several lengths", "must be one array") from None
    if act.dtype.kind not in "fiub":
        raise InvalidInput("act", str(act.dtype), "must be an array of real numbers")
    return act
