"""Gymnasium environments; importing this package registers their ids, single and batched.

arguments   Validation of the arguments of environments
pick        The pick scenario as Gymnasium environments, single and vectorised
raycast     Shaded images of capsules, cylinders and boxes by ray casting, in numpy
reach       The reach scenario as Gymnasium environments, single and vectorised
rendering   Images of one environment: table, robot, people, and targets or blocks
single_env  One environment of a batch as a Gymnasium environment
solids      Convex solids that rays are intersected with: capsules, upright cylinders and boxes
sorting     The sorting task as Gymnasium environments: one task, or a batch
tasks       Interface of batches for single and vector environments
vector_env  A batch as a Gymnasium vector environment
"""

import gymnasium

_PEOPLE = {
    "Pick": None,
    "PickWalker": ("walker",),
    "PickConstant": ("constant",),
    "PickFixedSpeed": ("fixed-speed",),
    "PickAlone": (),
    "Reach": None,
    "ReachWorker": ("worker",),
    "ReachConstant": ("constant",),
    "ReachFixedSpeed": ("fixed-speed",),
    "ReachAlone": (),
}
"""Ids and the people in the cell; None for the cell's own people."""

_SORTING = {"SortingE0": "sorting-e0", "SortingE1": "sorting-e1"}
"""Ids of the sorting task and their work cells."""

PEOPLE_IDS = tuple(f"tandem/{name}-v0" for name in _PEOPLE)
"""Registered ids of the robot beside people."""
SORTING_IDS = tuple(f"tandem/{name}-v0" for name in _SORTING)
"""Registered ids of the sorting task."""
IDS = (*PEOPLE_IDS, *SORTING_IDS)
"""All registered ids."""

for _name, _people in _PEOPLE.items():
    _scenario = "Pick" if _name.startswith("Pick") else "Reach"
    _entry = f"app.sim.envs.{_scenario.lower()}:{_scenario}"
    gymnasium.register(
        id=f"tandem/{_name}-v0",
        entry_point=f"{_entry}Env",
        vector_entry_point=f"{_entry}VectorEnv",
        kwargs={} if _people is None else {"people": _people},
    )

for _name, _cell in _SORTING.items():
    gymnasium.register(
        id=f"tandem/{_name}-v0",
        entry_point="app.sim.envs.sorting:SortingEnv",
        vector_entry_point="app.sim.envs.sorting:SortingVectorEnv",
        kwargs={"cell": _cell},
    )
