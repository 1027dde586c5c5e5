"""Index for pages of jobs in a state."""

from alembic import op

revision = "0008"
down_revision = "0007"


def upgrade() -> None:
    """Apply the change."""
    op.create_index("ix_jobs_state_number", "jobs", ["state", "number"])
    op.drop_index("ix_jobs_state", "jobs")


def downgrade() -> None:
    """Revert the change."""
    op.create_index("ix_jobs_state", "jobs", ["state"])
    op.drop_index("ix_jobs_state_number", "jobs")
