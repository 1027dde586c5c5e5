"""The fit of outcome probabilities to a policy that is already trained."""

import pytest

from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.training import pick
from tests.policies.conftest import TINY, Recorder, preset_of
from tools.fit_outcomes import with_new_outcomes

FEW = {"MIN_EPISODES": 10, "CELLS": 3}
"""Episodes and cells that a tiny training reaches, fewer than are needed otherwise."""


@pytest.fixture(scope="module")
def trained() -> Checkpoint:
    with pytest.MonkeyPatch.context() as patch:
        for name, number in FEW.items():
            patch.setattr(pick, name, number)
        return Recorder().run(preset_of("pick-td3", TINY)).checkpoint


def test_a_fit_repeats_that_of_the_training(
    trained: Checkpoint, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, number in FEW.items():
        monkeypatch.setattr(pick, name, number)
    least, most = trained.arrays()["outcome.between"].T
    assert (least <= 0.0).all() and (most >= 0.0).all() and (most - least > 0.1).all()
    assert with_new_outcomes(trained).sha256 == trained.sha256


def test_too_few_episodes_are_refused(trained: Checkpoint) -> None:
    with pytest.raises(ValueError, match="too few episodes ended"):
        with_new_outcomes(trained)
