"""The fit of outcome probabilities to a policy that is already trained."""

import pytest

from app.policies.training import pick
from tests.policies.conftest import TINY, Recorder, preset_of
from tools.fit_outcomes import with_new_outcomes


def test_a_fit_repeats_that_of_the_training(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pick, "MIN_EPISODES", 10)
    trained = Recorder().run(preset_of("pick-td3", TINY)).checkpoint
    assert any(name.startswith("outcome.") for name in trained.arrays())
    assert with_new_outcomes(trained).sha256 == trained.sha256


def test_too_few_episodes_are_refused() -> None:
    trained = Recorder().run(preset_of("pick-td3", TINY)).checkpoint
    with pytest.raises(ValueError, match="too few episodes ended"):
        with_new_outcomes(trained)
