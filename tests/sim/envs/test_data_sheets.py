"""Tables of the environments' docstrings state what the environments have."""

import inspect
import re
from math import prod

from app.sim.envs.pick import PickEnv
from app.sim.envs.reach import ReachEnv
from app.sim.envs.sorting import SortingEnv
from app.sim.pick.kernels.observation_layout import N_PICK
from app.sim.reach.kernels.observation import N_FEATURES
from app.sim.reach.kernels.option_features import N_OPTION_FEATURES
from app.sim.sorting.kernels.reward import SortingWeights

HEAD = "| group | size | content |\n"


def sizes(sheet: object) -> list[int]:
    """Total sizes of the tables of groups in a docstring."""
    tables = [part.split("\n\n")[0] for part in (inspect.getdoc(sheet) or "").split(HEAD)[1:]]
    return [
        sum(
            sum(prod(map(int, term.split(" x "))) for term in size.split(" + "))
            for size in re.findall(r"^\| [^|]+ \| (\d[\d x+]*) \|", table, re.MULTILINE)
        )
        for table in tables
    ]


def test_groups_of_a_pick_add_up() -> None:
    assert sizes(PickEnv) == [N_PICK]


def test_groups_of_reach_add_up() -> None:
    assert sizes(ReachEnv) == [N_FEATURES, N_OPTION_FEATURES]


def test_rewards_of_sorting_are_the_default_weights() -> None:
    text = (inspect.getdoc(SortingEnv) or "").split("## Reward\n")[1].split("##")[0]
    weights = SortingWeights()
    names = "move", "empty", "stuck", "fail", "back", "distance", "success"
    stated = [abs(float(found)) for found in re.findall(r"``([+-][\d.]+)(?: d / K)?``", text)]
    assert stated == [getattr(weights, name) for name in names]
