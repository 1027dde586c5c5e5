"""The order in which jobs ended, without the clock; until now it was that of the clock."""

import sqlalchemy as sa
from alembic import op

revision = "0014"
down_revision = "0013"


def upgrade() -> None:
    """Apply the change."""
    op.add_column("jobs", sa.Column("end_number", sa.Integer(), nullable=True))
    op.execute(
        "UPDATE jobs SET end_number = (SELECT count(*) FROM jobs AS other "
        "WHERE other.finished_at < jobs.finished_at "
        "OR other.finished_at = jobs.finished_at AND other.number <= jobs.number) "
        "WHERE finished_at IS NOT NULL"
    )


def downgrade() -> None:
    """Revert the change."""
    op.drop_column("jobs", "end_number")
