"""Indexes for pages of jobs of a kind or a preset."""

from alembic import op

revision = "0016"
down_revision = "0015"


def upgrade() -> None:
    """Apply the change."""
    op.create_index("ix_jobs_kind_number", "jobs", ["kind", "number"])
    op.create_index("ix_jobs_preset_number", "jobs", ["preset", "number"])


def downgrade() -> None:
    """Revert the change."""
    op.drop_index("ix_jobs_preset_number", "jobs")
    op.drop_index("ix_jobs_kind_number", "jobs")
