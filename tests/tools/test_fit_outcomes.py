"""The fit of outcome probabilities to a policy that is already trained."""

import pytest

from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.training import pick
from tests.policies.conftest import TINY, Recorder, preset_of
from tools.fit_outcomes import with_new_outcomes

FEW = 10
"""Number of episodes that a tiny training reaches, less than is needed otherwise."""


@pytest.fixture(scope="module")
def trained() -> Checkpoint:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pick, "MIN_EPISODES", FEW)
        return Recorder().run(preset_of("pick-td3", TINY)).checkpoint


def test_a_fit_repeats_that_of_the_training(
    trained: Checkpoint, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pick, "MIN_EPISODES", FEW)
    assert any(name.startswith("outcome.") for name in trained.arrays())
    assert with_new_outcomes(trained).sha256 == trained.sha256


def test_too_few_episodes_are_refused(trained: Checkpoint) -> None:
    with pytest.raises(ValueError, match="too few episodes ended"):
        with_new_outcomes(trained)
