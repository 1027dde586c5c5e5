"""Rules that hold for every test.

Compiled kernels are kept where the service keeps them, apart for each version of their sources.
Under ``CI=true`` a skip is a failure: a test that silently stops running guards nothing.
The imports of all tests leave about two million objects that stay. They are kept out of garbage
collection: a full one takes 0.3 s, which made up a third of the time until the first test.

Several processes take the tests file by file. Files of one ``xdist_group`` go to one process,
because each process would compile the kernels that they share; they are long and come first.
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


class _GroupOrFile(LoadFileScheduling):
    """Hands a process all tests of a group, or those of a file."""

    def _split_scope(self, nodeid: str) -> str:
        file, _, test = nodeid.partition("::")
        group = test.rpartition("]")[2].partition("@")[2]  # which --dist loadgroup appends
        return group or file


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> _GroupOrFile | None:
    return _GroupOrFile(config, log) if config.getvalue("dist") == "loadgroup" else None


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    items.sort(key=lambda item: item.get_closest_marker("xdist_group") is None)


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
