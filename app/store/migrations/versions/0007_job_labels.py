"""Name, notes, priority and origin of jobs."""

import sqlalchemy as sa
from alembic import op

revision = "0007"
down_revision = "0006"


def upgrade() -> None:
    """Apply the change."""
    op.add_column("jobs", sa.Column("name", sa.String(80), nullable=True))
    op.add_column("jobs", sa.Column("notes", sa.Text(), nullable=True))
    op.add_column("jobs", sa.Column("parent", sa.String(36), nullable=True))
    priority = sa.Column("priority", sa.Integer(), nullable=False, server_default="0")
    op.add_column("jobs", priority)


def downgrade() -> None:
    """Revert the change."""
    for name in ("priority", "parent", "notes", "name"):
        op.drop_column("jobs", name)
