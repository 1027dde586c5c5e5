"""Rename the table ``motions`` to ``recordings``; its constraints keep their names."""

from alembic import op

revision = "0005"
down_revision = "0004"


def upgrade() -> None:
    """Apply the change."""
    op.rename_table("motions", "recordings")


def downgrade() -> None:
    """Revert the change."""
    op.rename_table("recordings", "motions")
