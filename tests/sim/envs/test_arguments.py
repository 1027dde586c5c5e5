from typing import Any

import numpy as np
import pytest

from app.errors import InvalidInput
from app.sim.cells.cell import load_cell
from app.sim.envs.pick import PickEnv, PickVectorEnv
from app.sim.envs.reach import ReachEnv, ReachVectorEnv
from app.sim.envs.sorting import SortingEnv, SortingVectorEnv

SINGLE: Any = (ReachEnv, PickEnv, SortingEnv)
VECTOR: Any = (ReachVectorEnv, PickVectorEnv, SortingVectorEnv)


@pytest.mark.parametrize("make", [*SINGLE, *VECTOR])
@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (
            {"cell": 5},
            "cell = 'int' must be the name of a shipped work cell, or a Cell; choices",
        ),
        ({"settings": {}}, "settings = 'dict' must be "),
        ({"first_env": 1.5}, "first_env = 1.5 must be a whole number in [0, 2^31)"),
        ({"first_env": -1}, "first_env = -1 must be"),
        ({"first_env": True}, "first_env = True must be"),
        ({"first_env": 2**63}, "must be a whole number in [0, 2^31)"),
    ],
)
def test_arguments_of_another_type_are_refused(
    make: Any, arguments: dict[str, Any], text: str
) -> None:
    with pytest.raises(InvalidInput) as refused:
        make(**arguments)
    assert text in str(refused.value)


@pytest.mark.parametrize("make", [ReachEnv, PickEnv, ReachVectorEnv, PickVectorEnv])
@pytest.mark.parametrize("people", ["walker", 2, {"walker": 1}])
def test_people_are_a_list_of_kinds(make: Any, people: Any) -> None:
    with pytest.raises(InvalidInput, match="people = .* must be a list of kinds of people; ch"):
        make(people=people)


@pytest.mark.parametrize(
    ("make", "name"), [(ReachEnv, "shared-workspace"), (PickEnv, "pick-and-place")]
)
def test_cell_with_more_people_than_kernels_hold_is_refused(make: Any, name: str) -> None:
    cell = load_cell(name)
    crowded = cell.model_copy(update={"people": cell.people * 5})
    with pytest.raises(InvalidInput, match="people = .* must be at most 4"):
        make(cell=crowded)
    assert make(cell=cell.model_copy(update={"people": cell.people * 4})).reset(seed=1)


@pytest.mark.parametrize("make", VECTOR)
@pytest.mark.parametrize("number", [0, -1, 1.5, "2", True, None])
def test_batch_needs_a_number_of_environments(make: Any, number: Any) -> None:
    with pytest.raises(InvalidInput, match=r"num_envs = .* whole number in \[1, 2\^31\)"):
        make(num_envs=number)


def test_numbers_of_numpy_are_numbers_of_environments() -> None:
    env = SortingVectorEnv(num_envs=np.int64(2), first_env=np.int32(3))  # type: ignore[arg-type]
    same = SortingVectorEnv(num_envs=2, first_env=3)
    np.testing.assert_array_equal(env.reset(seed=1)[0], same.reset(seed=1)[0])


@pytest.mark.parametrize("make", [ReachEnv, SortingEnv, ReachVectorEnv, SortingVectorEnv])
@pytest.mark.parametrize("options", [{"epsiode": 3}, {"episode": 3, "mask": [True]}, [3], 5])
def test_unknown_options_are_refused_with_the_choices(make: Any, options: Any) -> None:
    with pytest.raises(InvalidInput, match=r"options = .*; choices: episode"):
        make().reset(seed=1, options=options)


@pytest.mark.parametrize("make", [*SINGLE, *VECTOR])
@pytest.mark.parametrize(
    ("seed", "options"),
    [
        (-1, {}),
        (1.5, {}),
        (True, {}),
        (2**63, {}),
        ([1, 2], {}),
        (7, {"episode": -1}),
        (7, {"episode": 1.5}),
    ],
)
def test_refused_reset_changes_nothing(make: Any, seed: Any, options: dict[str, Any]) -> None:
    env, same = make(), make()
    env.reset(seed=3), same.reset(seed=3)
    with pytest.raises(InvalidInput, match=r"(seed|options\.episode) = .* must be a whole"):
        env.reset(seed=seed, options=options)
    np.testing.assert_array_equal(env.reset()[0], same.reset()[0])
    assert env.np_random.integers(2**31) == same.np_random.integers(2**31)


@pytest.mark.parametrize("make", [*SINGLE, *VECTOR])
@pytest.mark.parametrize("seed", [np.int64(3), np.uint8(3)])
def test_seeds_of_numpy_are_seeds(make: Any, seed: Any) -> None:
    np.testing.assert_array_equal(make().reset(seed=seed)[0], make().reset(seed=3)[0])


@pytest.mark.parametrize("make", [ReachEnv, ReachVectorEnv])
@pytest.mark.parametrize(
    "given", ["a", ["0"] * 6, 6 * [1j], 6 * [None], [[0.0] * 6, [0.0] * 5]]
)
def test_actions_that_are_no_real_numbers_are_refused(make: Any, given: Any) -> None:
    env = make()
    env.reset(seed=1)
    with pytest.raises(InvalidInput, match="act = .* must be (an array of real num|one array)"):
        env.step(given)


@pytest.mark.parametrize("given", ["1", [[1], [2, 3]], 1j])
def test_moves_that_are_no_numbers_are_refused(given: Any) -> None:
    env = SortingEnv()
    env.reset(seed=1)
    with pytest.raises(InvalidInput, match="act = "):
        env.step(given)
