"""Copies of environments go on as the original would, and leave it alone."""

import copy
import pickle
from collections.abc import Callable
from typing import Any

import gymnasium
import numba
import numpy as np
import pytest

import app.sim.envs  # noqa: F401  (registers the ids)
from app.sim.sorting.batch import SortingSettings

LIVELY = SortingSettings(human_rate=0.2, localisation_rate=0.2, random_map_share=0.5)
KINDS: dict[str, tuple[str, dict[str, Any]]] = {
    "pick": ("tandem/Pick-v0", {}),
    "pick walker": ("tandem/PickWalker-v0", {}),
    "reach": ("tandem/Reach-v0", {}),
    "reach mix": ("tandem/Reach-v0", {"people": ("worker", "walker", "constant")}),
    "sorting": ("tandem/SortingE0-v0", {"settings": LIVELY}),
}
Copier = Callable[[Any], Any]
COPIERS: dict[str, Copier] = {
    "deepcopy": copy.deepcopy,
    "pickle": lambda env: pickle.loads(pickle.dumps(env)),
}


def stepped(env: Any, n_steps: int, seed: int = 11) -> list[Any]:
    """Everything an environment tells in some steps, resets after ends included."""
    env.action_space.seed(seed)
    infos: list[Any] = []
    for _ in range(n_steps):
        result = env.step(env.action_space.sample())
        infos.append(result)
        if np.ndim(result[2]) == 0 and (result[2] or result[3]):
            infos.append(env.reset())
    return infos


def assert_same(one: Any, other: Any) -> None:
    if isinstance(one, dict):
        assert set(one) == set(other)
        one, other = list(one.values()), [other[name] for name in one]
    if isinstance(one, list | tuple):
        assert len(one) == len(other)
        for a, b in zip(one, other, strict=True):
            assert_same(a, b)
    else:
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("copied", COPIERS.values(), ids=COPIERS)
@pytest.mark.parametrize("batched", [False, True], ids=["single", "batch"])
@pytest.mark.parametrize("kind", KINDS)
def test_a_copy_in_an_episode_goes_on_bit_by_bit(
    kind: str, batched: bool, copied: Copier
) -> None:
    env_id, more = KINDS[kind]
    env = gymnasium.make_vec(env_id, 3, **more) if batched else gymnasium.make(env_id, **more)
    env.reset(seed=5)
    stepped(env, 7, seed=1)
    other, third = copied(env), copied(env)
    alone = stepped(other, 40)
    stepped(third, 25, seed=99)  # moves neither of the two
    assert_same(stepped(env, 40), alone)


@pytest.mark.parametrize("copied", COPIERS.values(), ids=COPIERS)
@pytest.mark.parametrize("kind", ["pick", "reach", "sorting"])
def test_a_copy_before_the_first_reset_starts_like_the_original(
    kind: str, copied: Copier
) -> None:
    env_id, more = KINDS[kind]
    env = gymnasium.make(env_id, **more)
    other = copied(env)
    assert_same(env.reset(seed=8), other.reset(seed=8))
    assert_same(stepped(env, 5), stepped(other, 5))


def types(values: Any) -> list[Any]:
    """Types of the arrays in nested tuples, as compiled kernels distinguish them."""
    if isinstance(values, tuple):
        return [kind for value in values for kind in types(value)]
    return [numba.typeof(values)]


@pytest.mark.parametrize("copied", COPIERS.values(), ids=COPIERS)
@pytest.mark.parametrize(
    "env_id", ["tandem/Pick-v0", "tandem/Reach-v0", "tandem/ReachWorker-v0"]
)
def test_kernels_are_not_compiled_once_more_for_a_copy(env_id: str, copied: Copier) -> None:
    batch = gymnasium.make(env_id).unwrapped.batch  # type: ignore[attr-defined]
    other = copied(batch)
    for name in ("world", "_task", "state", "_work", "_observation_work"):
        assert types(getattr(batch, name)) == types(getattr(other, name))


def test_a_copy_renders_what_the_original_does() -> None:
    env = gymnasium.make("tandem/SortingE0-v0", render_mode="rgb_array")
    env.reset(seed=3)
    np.testing.assert_array_equal(copy.deepcopy(env).render(), env.render())
