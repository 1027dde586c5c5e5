"""Column ``jobs.checkpoint``: the evaluated checkpoint, whatever its alias later names."""

import sqlalchemy as sa
from alembic import op

revision = "0013"
down_revision = "0012"


def upgrade() -> None:
    """Apply the change."""
    op.add_column("jobs", sa.Column("checkpoint", sa.String(length=64), nullable=True))


def downgrade() -> None:
    """Revert the change."""
    op.drop_column("jobs", "checkpoint")
