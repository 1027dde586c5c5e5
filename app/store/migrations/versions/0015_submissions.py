"""What was submitted with an idempotency key: labels and budgets can be changed later."""

import sqlalchemy as sa
from alembic import op

revision = "0015"
down_revision = "0014"


def upgrade() -> None:
    """Apply the change."""
    op.add_column("jobs", sa.Column("submission_digest", sa.String(length=64), nullable=True))


def downgrade() -> None:
    """Revert the change."""
    op.drop_column("jobs", "submission_digest")
