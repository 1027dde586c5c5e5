"""Record the shipped policy in test 4, as in thesis figure 3.3 (a).

    python -m tools.docs.sorting.recording

Writes ``docs/img/sorting/test-4.gif``: the state before each attempt, and the last one. The
episode is the first one of ``python -m app evaluate sorting-tests`` that is solved with one
failed pick, as in the run that the thesis shows.
"""

from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle

from app.policies.checkpoints import pretrained
from app.policies.evaluation.sorting.benchmark_tasks import start_test
from app.policies.evaluation.sorting.episodes import (
    ENDLESS,
    ScriptedInterferences,
    greedy,
    run_episodes,
)
from app.policies.evaluation.statistics import Index
from app.policies.inference.sorting_policy import SortingPolicy
from app.sim.cells.cell import Cell, load_cell
from app.sim.cells.parts import Station
from app.sim.sorting.batch import SortingBatch, SortingSettings, fail_of
from app.sim.sorting.benchmark_tasks import TESTS
from app.sim.sorting.layout import block_height, half_size
from app.sim.sorting.state import NULL, SortingShape, SortingState
from tools.arguments import parser_of
from tools.docs.results import IMAGES
from tools.docs.world.plots import LIGHT, STYLE

IMAGE = IMAGES / "sorting/test-4.gif"
SEED, N_EPISODES = 11, 20
"""Seed of the stored result, and number of its episodes that are searched."""
PER_SECOND, LAST = 1, 3
"""Frames per second, and how many times the last one is shown."""
HEIGHTS, DEPTH = 1.4, 0.9
"""Scale of heights and of depth along the table in the picture."""
COLOURS = {"red": "#c2413b", "blue": "#2f6db5"}


def recorded() -> tuple[list[SortingState], SortingShape, Cell]:
    """Return the states of one episode, the shape of the task and its cell."""
    policy, test = SortingPolicy(pretrained.load("sorting-e0")), TESTS[3]
    cell = load_cell(policy.cell)
    fail, settings = fail_of(cell), SortingSettings(horizon_factor=ENDLESS)
    batch = SortingBatch(policy.shape, fail, N_EPISODES, SEED, settings)
    start_test(batch, test, fail, SEED)
    states: list[list[SortingState]] = [[] for _ in range(N_EPISODES)]
    choose = greedy(policy.values)

    def recording(running: SortingBatch, which: Index) -> Index:
        for e in which.tolist():
            states[e].append(running.state_of(e))
        return choose(running, which)

    script = ScriptedInterferences(test, N_EPISODES, SEED)
    episodes = run_episodes(batch, recording, script=script)
    e = int(np.flatnonzero(episodes.success & (episodes.failed == 1))[0])
    return [*states[e], batch.state_of(e)], policy.shape, cell


def captions(states: list[SortingState]) -> list[str]:
    """Return what happened before each state."""
    said = ["Start"]
    for before, now in zip(states, states[1:], strict=False):
        if now.n_objects > before.n_objects:
            said.append("Goal reached; a person adds a large block to it")
        elif (now.towers == before.towers).all():
            said.append("The pick failed")
        else:
            up = now.heights.sum() > before.heights.sum()
            said.append("A block is sorted" if up else "A sorted block makes room")
    said[-1] = "Goal reached"
    return said


def draw(axis: Axes, state: SortingState, shape: SortingShape, cell: Cell, title: str) -> None:
    """Draw one state: clutter slots with failure probabilities, towers with their goals."""
    axis.clear()
    axis.set(xlim=(-0.85, 0.85), ylim=(-0.06, 0.34), aspect="equal")
    axis.set_title(title, loc="center")
    axis.set_axis_off()
    height, towers = block_height(cell), cell.stations_of("cluster")
    colours = [COLOURS[str(one.colour)] for one in towers]

    def block(code: int, where: Station, level: int, *, there: bool) -> None:
        half = half_size(cell, shape.size_of(code), shape.n_sizes)[0]
        x, z = where.position[0], _depth(where) + HEIGHTS * height * level
        look: dict[str, Any] = {
            "fc": colours[shape.colour_of(code)] if there else "none",
            "lw": 0.8,
        }
        look |= {"ec": "white"} if there else {"ec": colours[shape.colour_of(code)], "ls": ":"}
        axis.add_patch(Rectangle((x - half, z), 2 * half, HEIGHTS * height, **look))

    places = [*cell.stations_of("clutter"), *towers]
    for where in sorted(places, key=lambda one: -one.position[1]):
        x, z = where.position[0], _depth(where)
        corners = [(x - 0.08, z - 0.03), (x + 0.08, z - 0.03), (x + 0.07, z + 0.04)]
        axis.add_patch(Polygon([*corners, (x - 0.07, z + 0.04)], fc=LIGHT))
    for k, where in enumerate(cell.stations_of("clutter")):
        text = f"{100 * state.fail[k]:.0f} %"
        at = where.position[0], _depth(where) - 0.022
        axis.text(*at, text, color="#4b5563", fontsize=6, ha="center")
        if state.clutter[k] != NULL:
            block(int(state.clutter[k]), where, 0, there=True)
    for where, tower, goal in zip(towers, state.towers, state.goal, strict=True):
        for level, (code, wanted) in enumerate(zip(tower, goal, strict=True)):
            if max(code, wanted) != NULL:
                block(int(code or wanted), where, level, there=code != NULL)


def _depth(station: Station) -> float:
    """Return the height in the picture of a place on the table [m]."""
    return DEPTH * (station.position[1] - 0.45)


def main() -> None:
    """Write the recording."""
    states, shape, cell = recorded()
    said = captions(states)
    with mpl.rc_context({**STYLE, "figure.constrained_layout.use": False}):
        figure = Figure(figsize=(7.0, 2.0))
        axis = figure.add_axes((0.0, 0.0, 1.0, 0.9))

        def frame(k: int) -> list[Axes]:
            draw(axis, states[k], shape, cell, f"t = {k}   {said[k]}")
            return [axis]

        shown = [*range(len(states)), *[len(states) - 1] * LAST]
        animation = FuncAnimation(figure, frame, frames=shown)
        animation.save(IMAGE, writer=PillowWriter(fps=PER_SECOND), dpi=90)


if __name__ == "__main__":
    parser_of(__doc__).parse_args()
    main()
