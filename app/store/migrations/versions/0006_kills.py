"""Kills of a job with its server, and the reason for which its worker cannot write."""

import sqlalchemy as sa
from alembic import op

revision = "0006"
down_revision = "0005"


def upgrade() -> None:
    """Apply the change."""
    op.add_column("jobs", sa.Column("kills", sa.Integer(), nullable=False, server_default="0"))
    op.add_column("jobs", sa.Column("waiting", sa.String(length=64), nullable=True))


def downgrade() -> None:
    """Revert the change."""
    op.drop_column("jobs", "waiting")
    op.drop_column("jobs", "kills")
