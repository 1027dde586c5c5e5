"""Rules that hold for every test.

Compiled kernels are kept where the service keeps them, apart for each version of their sources.
Under ``CI=true`` a skip is a failure: a test that silently stops running guards nothing.
The imports of all tests leave about two million objects that stay. They are kept out of garbage
collection: a full one takes 0.3 s, which made up a third of the time until the first test.

Several processes take the tests file by file, those of ``FIRST`` before others; files of one of
its groups go to one process.
"""

import gc
import os
from collections.abc import Generator
from pathlib import Path

import pytest
from xdist.remote import Producer
from xdist.scheduler import LoadFileScheduling

from app.sim.core.kernel_cache import kernel_cache

gc.disable()  # until the first test
os.environ.setdefault("OMP_NUM_THREADS", "1")  # as in the service; before torch is loaded
IN_CI = os.environ.get("CI", "").lower() in ("1", "true")


os.environ.setdefault("NUMBA_CACHE_DIR", str(kernel_cache(Path(__file__).parents[1] / "data")))


FIRST = (
    # Each process would compile the kernels that these share.
    (
        "policies/evaluation/pick/test_ssm.py",
        "policies/evaluation/sorting/test_cycle_time.py",
        "policies/evaluation/sorting/test_people.py",
        "sim/pick/test_monitored_batch.py",
    ),
    (
        "policies/evaluation/reach/test_ssm.py",
        "policies/inference/test_rollout_constraint.py",
        "sim/reach/monitored/test_batch.py",
        "sim/reach/monitored/test_planners.py",
    ),
    (
        "policies/evaluation/safety/test_ssm.py",
        "policies/evaluation/test_registry.py",
        "sim/safety/test_adversarial_trials.py",
    ),
    # These share a training.
    ("jobs/test_run.py", "jobs/remote/test_run.py"),
    # These are long. At most two processes draw the scene; others have time to wait.
    ("browser/test_job_forms.py",),
    ("browser/scenes/test_windows.py", "browser/scenes/test_view.py"),
    ("browser/scenes/test_servers.py",),
    ("browser/test_connections.py",),
    ("browser/test_training.py",),
)
"""Groups of test files, the longest first. Marks ``xdist_group`` have no effect with pytest 9.2
(https://github.com/pytest-dev/pytest-xdist/issues/1386)."""
GROUPS = {f"tests/{file}": n for n, group in enumerate(FIRST) for file in group}


def _group_of(nodeid: str) -> tuple[int, str]:
    """Return the place of a test's group or, behind all groups, its file."""
    file = nodeid.partition("::")[0]
    return (GROUPS[file], "") if file in GROUPS else (len(FIRST), file)


class _GroupOrFile(LoadFileScheduling):
    """Hands a process all tests of a group, or those of a file."""

    def _split_scope(self, nodeid: str) -> str:
        return " ".join(map(str, _group_of(nodeid)))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> _GroupOrFile | None:
    return _GroupOrFile(config, log) if config.getvalue("dist") == "loadfile" else None


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    items.sort(key=lambda item: _group_of(item.nodeid)[0])


@pytest.hookimpl(tryfirst=True)
def pytest_runtestloop() -> None:
    gc.collect()
    gc.freeze()
    gc.enable()


def pytest_unconfigure() -> None:
    gc.unfreeze()  # the interpreter's end collects everything


def _fail_instead_of_skip(report: pytest.TestReport | pytest.CollectReport) -> None:
    if IN_CI and report.skipped and not hasattr(report, "wasxfail"):
        report.outcome = "failed"
        report.longrepr = f"skipped under CI: {report.longrepr}"


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport() -> Generator[None, pytest.TestReport, pytest.TestReport]:
    report = yield
    _fail_instead_of_skip(report)
    return report


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report() -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    report = yield
    _fail_instead_of_skip(report)
    return report
