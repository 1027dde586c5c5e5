"""Parts of jobs: a name for all kinds of them, and an index for pages."""

from alembic import op

revision = "0012"
down_revision = "0011"


def upgrade() -> None:
    """Apply the change."""
    op.drop_index("ix_jobs_sweep", "jobs")
    op.execute("ALTER TABLE jobs RENAME COLUMN sweep TO part_of")
    op.create_index("ix_jobs_part_of_number", "jobs", ["part_of", "number"])


def downgrade() -> None:
    """Revert the change."""
    op.drop_index("ix_jobs_part_of_number", "jobs")
    op.execute("ALTER TABLE jobs RENAME COLUMN part_of TO sweep")
    op.create_index("ix_jobs_sweep", "jobs", ["sweep"])
