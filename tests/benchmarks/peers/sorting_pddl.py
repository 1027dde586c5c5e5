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
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from app.sim.sorting.state import NULL, Codes, SortingShape, SortingState, code_counts

DOMAIN = Path(__file__).with_name("sorting.pddl")
PACKAGES = {
    "pyperplan": "pyperplan",
    "fast-downward": "up_fast_downward",
    "fast-downward-opt": "up_fast_downward",
}
"""Planners, and the module each comes in."""
MEMORY = 6 * 2**30
"""Bytes a planner's process may take."""
PATIENCE = 4.0
"""A planner is ended after so many times its processor seconds by the clock."""


OUT_OF_TIME = (-signal.SIGKILL, -signal.SIGXCPU, 21, 23)
"""How a planner ends whose time is over; 21 and 23 are Fast Downward's."""


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
    return importlib.util.find_spec(PACKAGES[planner]) is not None


def problem(state: SortingState, shape: SortingShape) -> str:
    """Return an instance in PDDL; codes that no object has are left out."""
    spare = code_counts(state.clutter, shape)
    there = np.flatnonzero(spare + code_counts(state.towers, shape))
    codes = [int(code) for code in there if code != NULL]
    numbers = range(shape.n_slots + 1)
    facts = ["(free-hand)", *(f"(spare c{code} n{spare[code]})" for code in codes)]
    facts += [f"(next n{n} n{n + 1})" for n in numbers[:-1]]
    return "\n".join(
        [
            "(define (problem instance) (:domain sorting) (:objects",
            " ".join(f"c{code}" for code in codes) + " - code",
            " ".join(f"t{tower}" for tower in range(shape.n_colours)) + " - tower",
            " ".join(f"n{n}" for n in numbers) + " - level)",
            "(:init " + " ".join(facts + _facts(state.towers)) + ")",
            "(:goal (and (free-hand) " + " ".join(_facts(state.goal)) + ")))",
        ]
    )


def _facts(towers: Codes) -> list[str]:
    """Return what is true of towers."""
    facts = []
    for tower, row in enumerate(towers):
        codes = row[row != NULL]
        facts.append(f"(height t{tower} n{len(codes)})")
        facts += [f"(shows t{tower} n{level} c{code})" for level, code in enumerate(codes)]
    return facts


def plan(planner: str, state: SortingState, shape: SortingShape, cap_s: float) -> Found:
    """Let a planner plan from scratch, with at most ``cap_s`` processor seconds."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        (place / "problem.pddl").write_text(problem(state, shape))
        begin, code = _children_s(), _run(_command(planner, place), place, cap_s)
        spent = _children_s() - begin
        answers = sorted(place.glob("*.soln")) + sorted(place.glob("sas_plan*"))
        if code == -signal.SIGKILL and spent < 0.9 * cap_s:
            note = f"stopped by the clock after {spent:.0f} s of processor time"
            return Found(moves=None, cpu_s=spent, note=note)
        if spent >= cap_s or code in OUT_OF_TIME:
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
    clutter = Counter(f"c{code}" for code in state.clutter if code != NULL)
    towers = [[f"c{code}" for code in row if code != NULL] for row in state.towers]
    wanted = [[f"c{code}" for code in row if code != NULL] for row in state.goal]
    held = None
    for name, code, *more in steps:
        tower = towers[int(more[0][1:])] if name.endswith("tower") else []
        if name.startswith("take") == (held is not None):
            raise ValueError(f"{name} {code} with {held} in the hand")
        if name == "take-from-clutter":
            clutter[code] -= 1
            held = code
        elif name == "take-from-tower":
            held = tower.pop() if tower else None
        elif name == "put-on-tower":
            tower.append(code)
        else:
            clutter[code] += 1
        if min(clutter.values(), default=0) < 0 or held != code:
            raise ValueError(f"there is no {code} to {name}")
        held = held if name.startswith("take") else None
    if held is not None or towers != wanted:
        raise ValueError("the plan does not reach the goal")
    return len(steps) // 2


def _command(planner: str, place: Path) -> list[str]:
    """Return how a planner is started on the problem in a folder."""
    files = [str(DOMAIN), str(place / "problem.pddl")]
    if planner == "pyperplan":
        return [sys.executable, "-m", "pyperplan", "-H", "hff", "-s", "gbf", *files]
    spec = importlib.util.find_spec("up_fast_downward")
    assert spec is not None and spec.submodule_search_locations
    driver = Path(spec.submodule_search_locations[0]) / "downward" / "fast-downward.py"
    start = [sys.executable, str(driver), "--plan-file", str(place / "sas_plan")]
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
