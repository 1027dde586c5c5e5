"""State of objects as named arrays and JSON values, to resume trainings exactly.

A class lists in ``STATE`` the attributes that change while it works. Arrays are restored in
place, because other objects refer to them; random generators, numbers, nested objects and
(named) tuples of arrays are supported. Anything else in ``STATE`` is an error, so that no part
of a state is left out silently.
"""

import json
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from app.errors import CheckpointMismatch

State = dict[str, Any]
"""Arrays and JSON values by dotted names."""
NUMBERS = (bool, int, float, str, type(None))


class Stateful:
    """Object whose state is in the attributes named by ``STATE``."""

    STATE: ClassVar[tuple[str, ...]] = ()
    """Attributes that change while the object works."""

    def state_dict(self) -> State:
        """Return a copy of the state."""
        found: State = {}
        for name in self.STATE:
            _add(found, name, getattr(self, name))
        return found

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Restore a state of :meth:`state_dict`.

        Raises:
            CheckpointMismatch: A part is missing, or an array has another shape or type.
        """
        for name in self.STATE:
            value = getattr(self, name)
            if isinstance(value, NUMBERS):
                setattr(self, name, _required(state, name))
            else:
                _load(state, name, value)


def under(state: Mapping[str, Any], prefix: str) -> State:
    """Return the entries whose names start with ``prefix.``, without it."""
    start = f"{prefix}."
    return {
        name.removeprefix(start): value
        for name, value in state.items()
        if name.startswith(start)
    }


def _add(found: State, path: str, value: Any) -> None:
    """Add the state of one attribute to the found entries."""
    if isinstance(value, np.ndarray):
        if value.flags.writeable:  # others are constants
            found[path] = value.copy()
    elif isinstance(value, np.random.Generator):
        found[path] = json.dumps(value.bit_generator.state)
    elif isinstance(value, tuple):
        for name, item in _items(value):
            if not isinstance(item, NUMBERS):
                _add(found, f"{path}.{name}", item)
    elif isinstance(value, NUMBERS):
        found[path] = value
    elif isinstance(value, Stateful):
        found.update({f"{path}.{name}": one for name, one in value.state_dict().items()})
    else:
        raise TypeError(f"{path}: cannot store a {type(value).__name__}")


def _load(state: Mapping[str, Any], path: str, value: Any) -> None:
    """Restore the state of one attribute in place."""
    if isinstance(value, np.ndarray):
        if value.flags.writeable:
            _fill(path, value, _required(state, path))
    elif isinstance(value, np.random.Generator):
        value.bit_generator.state = json.loads(_required(state, path))
    elif isinstance(value, tuple):
        for name, item in _items(value):
            if not isinstance(item, NUMBERS):
                _load(state, f"{path}.{name}", item)
    else:
        value.load_state_dict(under(state, path))


def _items(value: tuple[Any, ...]) -> list[tuple[str, Any]]:
    names = getattr(value, "_fields", None) or map(str, range(len(value)))
    return list(zip(names, value, strict=True))


def _required(state: Mapping[str, Any], path: str) -> Any:
    if path not in state:
        raise CheckpointMismatch(f"state {path}", "present", "missing")
    value = state[path]
    return value.copy() if isinstance(value, np.ndarray) else value


def _fill(path: str, array: Any, saved: Any) -> None:
    kinds = [(one.dtype.str, one.shape) for one in (array, np.asarray(saved))]
    if kinds[0] != kinds[1]:
        raise CheckpointMismatch(f"state {path}", *kinds)
    array[...] = saved
