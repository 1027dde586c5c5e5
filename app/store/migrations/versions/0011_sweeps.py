"""Jobs of a sweep: the sweep and the number of the trial."""

import sqlalchemy as sa
from alembic import op

revision = "0011"
down_revision = "0010"


def upgrade() -> None:
    """Apply the change."""
    op.add_column("jobs", sa.Column("sweep", sa.String(length=36), nullable=True))
    op.add_column("jobs", sa.Column("trial", sa.Integer(), nullable=True))
    op.create_index("ix_jobs_sweep", "jobs", ["sweep"])


def downgrade() -> None:
    """Revert the change."""
    op.drop_index("ix_jobs_sweep", "jobs")
    op.drop_column("jobs", "trial")
    op.drop_column("jobs", "sweep")
