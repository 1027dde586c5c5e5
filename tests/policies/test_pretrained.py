import pytest

from app.errors import Damaged, NotFound
from app.policies.checkpoints import pretrained


@pytest.mark.parametrize("alias", pretrained.ALIASES)
def test_shipped_checkpoint_has_the_id_it_was_shipped_with(alias: str) -> None:
    assert pretrained.load(alias).sha256 == pretrained.SHA256[alias]


def test_file_that_is_not_the_shipped_one_is_damaged(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(pretrained.SHA256, "pick", "0" * 64)
    with pytest.raises(Damaged, match="'pick' is damaged.*install the package again"):
        pretrained.load("pick")


def test_unknown_alias_names_the_known_ones() -> None:
    with pytest.raises(
        NotFound, match="known: pick, pick-monitored, sorting-e0, sorting-e1, reach"
    ):
        pretrained.load("pikc")
