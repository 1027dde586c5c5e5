"""The sorting task for planners that read PDDL, each plan found by a process of its own.

``sorting.pddl`` is the domain; :func:`problem` writes an instance. Times are processor seconds
of the planner's processes, start of Python included. A plan is replayed by the rules of the
task before it counts.

pyperplan          greedy best-first search with the FF heuristic
fast-downward      LAMA's first iteration, the build that ``up-fast-downward`` packs
fast-downward-opt  A* with LM-cut: fewest actions
"""

import importlib.util
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from app.sim.sorting_state import NULL, SortingShape, SortingState

DOMAIN = Path(__file__).with_name("sorting.pddl")
PLANNERS = {
    "pyperplan": "pyperplan",
    "fast-downward": "up_fast_downward",
    "fast-downward-opt": "up_fast_downward",
}
"""Planners, and the package each comes with."""
MEMORY = 6 * 2**30
"""Bytes a planner's process may take."""
PATIENCE = 4.0
"""A planner is ended after so many times its processor seconds by the clock."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """What a planner answered."""

    moves: int | None
    """Moves of its plan; None where it found none."""
    cpu_s: float
    """Processor seconds."""
    note: str = ""
    """Why there is no plan."""


def installed(planner: str) -> bool:
    """Return whether a planner's package is there."""
    return importlib.util.find_spec(PLANNERS[planner]) is not None


def problem(state: SortingState, shape: SortingShape) -> str:
    """Return an instance in PDDL: every object by itself, the goal by codes."""
    levels, codes = range(shape.n_cells + 1), range(1, shape.n_types + 1)
    facts, n = ["(free-hand)"], 0
    for code in state.clutter[state.clutter != NULL]:
        facts += [f"(clutter o{n})", f"(looks o{n} c{code})"]
        n += 1
    for tower, row in enumerate(state.towers):
        for level, code in enumerate(row[row != NULL]):
            facts += [f"(on o{n} t{tower} l{level})", f"(looks o{n} c{code})"]
            facts.append(f"(shows t{tower} l{level} c{code})")
            n += 1
    facts += [f"(height t{t} l{h})" for t, h in enumerate(state.heights)]
    facts += [f"(next l{level} l{level + 1})" for level in levels[:-1]]
    wanted = [f"(height t{t} l{(row != NULL).sum()})" for t, row in enumerate(state.goal)]
    for tower, row in enumerate(state.goal):
        wanted += [f"(shows t{tower} l{k} c{c})" for k, c in enumerate(row[row != NULL])]
    return "\n".join(
        [
            "(define (problem instance) (:domain sorting) (:objects",
            " ".join(f"o{k}" for k in range(n)) + " - object-to-sort",
            " ".join(f"t{k}" for k in range(shape.n_colours)) + " - tower",
            " ".join(f"l{k}" for k in levels) + " - level",
            " ".join(f"c{k}" for k in codes) + " - code)",
            "(:init " + " ".join(facts) + ")",
            "(:goal (and " + " ".join(wanted) + ")))",
        ]
    )


def plan(planner: str, state: SortingState, shape: SortingShape, cap_s: float) -> Found:
    """Let a planner plan from scratch, with at most ``cap_s`` processor seconds."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        (place / "problem.pddl").write_text(problem(state, shape))
        begin, code = _children_s(), _run(_command(planner, place), place, cap_s)
        spent = _children_s() - begin
        answers = sorted(place.glob("*.soln")) + sorted(place.glob("sas_plan*"))
        if spent >= cap_s or code in (-signal.SIGKILL, -signal.SIGXCPU):
            return Found(moves=None, cpu_s=spent, note=f"no plan in {cap_s:g} s")
        if not answers:
            return Found(moves=None, cpu_s=spent, note=f"ended with {code}, without a plan")
        lines = answers[0].read_text().splitlines()
        steps = [line.strip("() \r").split() for line in lines if line.startswith("(")]
    return Found(moves=replayed(steps, state), cpu_s=spent)


def replayed(steps: list[list[str]], state: SortingState) -> int:
    """Carry a plan out by the rules of the task; return how many moves it takes.

    Raises:
        ValueError: It breaks a rule or does not reach the goal.
    """
    there = [int(code) for code in state.clutter if code != NULL]
    clutter = {f"o{k}": code for k, code in enumerate(there)}
    towers: list[list[tuple[str, int]]] = []
    n = len(there)
    for row in state.towers:
        codes = [int(code) for code in row if code != NULL]
        towers.append([(f"o{n + k}", code) for k, code in enumerate(codes)])
        n += len(codes)
    held: tuple[str, int] | None = None
    for name, thing, *more in steps:
        tower = towers[int(more[1][1:])] if more else []
        if name.startswith("take") and held is None:
            held = tower.pop() if more else (thing, clutter.pop(thing))
        elif name == "put-on-tower" and held is not None:
            tower.append(held)
            held = None
        elif name == "put-in-clutter" and held is not None:
            clutter[held[0]] = held[1]
            held = None
        else:
            raise ValueError(f"{name} with {held} in the hand")
        if held is not None and held[0] != thing:
            raise ValueError(f"{thing} is not on top of its tower")
    reached = [[code for _, code in tower] for tower in towers]
    wanted = [[int(code) for code in row if code != NULL] for row in state.goal]
    if held is not None or reached != wanted:
        raise ValueError("the plan does not reach the goal")
    return len(steps) // 2


def _command(planner: str, place: Path) -> list[str]:
    """Return how a planner is started on the problem in a folder."""
    files = [str(DOMAIN), str(place / "problem.pddl")]
    if planner == "pyperplan":
        return ["/tmp/pv/bin/python", "-m", "pyperplan", "-H", "hff", "-s", "gbf", *files]
    spec = importlib.util.find_spec("up_fast_downward")
    assert spec is not None and spec.submodule_search_locations
    driver = Path(spec.submodule_search_locations[0]) / "downward" / "fast-downward.py"
    start = ["/tmp/pv/bin/python", str(driver), "--plan-file", str(place / "sas_plan")]
    if planner == "fast-downward":
        return [*start, "--alias", "lama-first", *files]
    return [*start, *files, "--search", "astar(lmcut())"]


def _run(command: list[str], place: Path, cap_s: float) -> int:
    """Run a planner in a session of its own; end all of it when its time is over."""

    def limits() -> None:
        resource.setrlimit(resource.RLIMIT_CPU, (int(cap_s), int(cap_s) + 1))
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))

    with subprocess.Popen(
        command,
        cwd=place,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        preexec_fn=limits,
        start_new_session=True,
    ) as child:
        ends = time.monotonic() + PATIENCE * cap_s
        while child.poll() is None and time.monotonic() < ends:
            time.sleep(0.01)
        if child.poll() is None:
            os.killpg(child.pid, signal.SIGKILL)
        return child.wait()


def _children_s() -> float:
    """Return processor seconds of all ended children and theirs."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
