"""What the service holds in memory of checkpoints that go with old jobs."""

from dataclasses import replace
from pathlib import Path

import pytest

from app.errors import Damaged, InvalidInput
from app.policies.checkpoints import pretrained
from app.policies.checkpoints.checkpoint import Checkpoint
from app.store import attempts, completion
from app.store.engine import Store
from app.store.records import ResumeState
from jobs.checkpoints import to_store
from tests.jobs.remote.serving import serving
from tests.support.databases import started


def test_checkpoint_that_goes_with_an_old_job_is_forgotten(
    store: Store, tmp_path: Path
) -> None:
    shipped = pretrained.load("pick")
    made = to_store(Checkpoint({**shipped.manifest, "seed": 1000}, shipped.tensors))
    claim = started(store)
    state = ResumeState(step=1, manifest={}, tensors=b"state")
    attempts.record_checkpoint(store, claim, 1, made, state)
    completion.finish(store, claim)
    with serving(store, tmp_path) as (_, services):
        assert services.task_policies.load(made.sha256).checkpoint == made.sha256
        services.checkpoints.mark_damaged(Damaged("checkpoint", "old", "", made.sha256))
        replace(services.retention, keep_jobs=0).apply(services.store)
        assert services.checkpoints.damaged == ()
        with pytest.raises(InvalidInput, match="is not a stored checkpoint"):
            services.task_policies.load(made.sha256)
