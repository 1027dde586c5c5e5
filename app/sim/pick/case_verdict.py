"""Verdict on a run of a case study: expected, observed, as expected or not.

The live cell and the evaluation of the case studies share this rule. It considers the whole
run: the first choice, the target switches, and the end.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

from app.sim.pick.cases import Case

Label = Callable[[str], str]
"""Maps a station id to its name for people."""
End = Literal["reached", "contact", "timeout"]
"""End of a run; ``reached``: the object was lifted or set down without contact."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TargetChoice:
    """A goal that was chosen, and when."""

    t_s: float
    """Time since the start of the run [s]."""
    goal: str
    """Station id."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CaseRun:
    """What happened in a case study so far."""

    choices: tuple[TargetChoice, ...] = ()
    """The first choice and every target switch, in order."""
    end: End | None = None
    """How it ended; None while it runs."""
    end_s: float | None = None
    """When it ended [s]."""

    def choose(self, t_s: float, goal: str) -> "CaseRun":
        """Return the run with the choice at a time [s]; the same where it is the last one."""
        if self.end is not None or (self.choices and self.choices[-1].goal == goal):
            return self
        return replace(self, choices=(*self.choices, TargetChoice(t_s=t_s, goal=goal)))

    def finish(self, end: End, t_s: float) -> "CaseRun":
        """Return the run with its end at a time [s]; the first end counts."""
        return self if self.end is not None else replace(self, end=end, end_s=t_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """What a case study or a sorting test is judged by."""

    expected: str
    """What it expects, one sentence."""
    observed: str
    """What happened so far, one sentence."""
    as_expected: bool | None
    """The verdict; None while it is open."""
    choices: tuple[TargetChoice, ...] = ()
    """In a case study, the first choice and every target switch."""


def is_as_expected(case: Case, run: CaseRun) -> bool | None:
    """Return whether a run shows what its case study is for; None while it is open.

    It does where the first choice, the number of target switches and the last goal
    are those of the case, and the run ended without contact and in time.
    """
    if run.end is None:
        return None
    if run.end != "reached" or not run.choices:
        return False
    return all(clauses_of(case, run).values())


def clauses_of(case: Case, run: CaseRun) -> dict[str, bool]:
    """Return whether first choice, switches and last goal of a run are those of a case.

    Args:
        run: A run with a choice.
    """
    (least, most), switches = case.switches, len(run.choices) - 1
    return {
        "first": case.first in (None, run.choices[0].goal),
        "switches": least <= switches and (most is None or switches <= most),
        "end": run.choices[-1].goal == case.expected,
    }


def judge(case: Case, run: CaseRun, label: Label) -> Verdict:
    """Return what a case study expects, what a run shows, and whether both agree."""
    return Verdict(
        expected=_expected(case, label),
        observed=_observed(run, label),
        as_expected=is_as_expected(case, run),
        choices=run.choices,
    )


def _expected(case: Case, label: Label) -> str:
    parts = [] if case.first is None else [f"selects {label(case.first)} first"]
    if case.switches != (0, None):
        parts.append(
            {
                (0, 0): "does not switch",
                (1, 1): "switches once",
                (1, None): "switches at least once",
            }[case.switches]
        )
    return f"The robot {_joined([*parts, f'ends at {label(case.expected)}'])}."


def _observed(run: CaseRun, label: Label) -> str:
    if not run.choices:
        return "The robot has selected nothing yet."
    first, *later = run.choices
    parts = [f"selected {label(first.goal)} first"]
    if later:
        turns = [f"to {label(one.goal)} at {one.t_s:.1f} s" for one in later]
        parts.append(f"switched {_joined(turns)}")
    elif run.end is not None:
        parts.append("did not switch")
    if run.end is None:
        return f"The robot {_joined(parts)}."
    ends = {
        "reached": f"picked {label(run.choices[-1].goal)}",
        "contact": "was in contact",
        "timeout": "timed out",
    }
    return f"The robot {_joined([*parts, f'{ends[run.end]} at {run.end_s:.1f} s'])}."


def _joined(parts: list[str]) -> str:
    """Return parts as a list in words."""
    return " and ".join([", ".join(parts[:-1]), parts[-1]] if len(parts) > 1 else parts)
