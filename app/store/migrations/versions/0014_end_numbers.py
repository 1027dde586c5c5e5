"""The order in which jobs ended, without the clock; until now it was that of the clock."""

import sqlalchemy as sa
from alembic import op

revision = "0014"
down_revision = "0013"


def upgrade() -> None:
    """Apply the change."""
    op.add_column("jobs", sa.Column("end_number", sa.Integer(), nullable=True))
    op.execute(
        "UPDATE jobs SET end_number = ended.place FROM (SELECT id, row_number() OVER "
        "(ORDER BY finished_at, number) AS place FROM jobs WHERE finished_at IS NOT NULL) "
        "AS ended WHERE ended.id = jobs.id"
    )
    op.create_index("ix_jobs_end_number", "jobs", ["end_number"])


def downgrade() -> None:
    """Revert the change."""
    op.drop_index("ix_jobs_end_number", "jobs")
    op.drop_column("jobs", "end_number")
