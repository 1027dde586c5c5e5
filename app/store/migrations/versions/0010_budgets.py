"""Budgets of jobs, their run time, and the budget that ended them."""

import sqlalchemy as sa
from alembic import op

revision = "0010"
down_revision = "0009"

COLUMNS = (
    ("step_budget", sa.BigInteger()),
    ("time_budget_s", sa.Float()),
    ("ended_by", sa.String(length=16)),
)


def upgrade() -> None:
    """Apply the change."""
    for name, kind in COLUMNS:
        op.add_column("jobs", sa.Column(name, kind, nullable=True))
    run_s = sa.Column("run_s", sa.Float(), nullable=False, server_default="0")
    op.add_column("jobs", run_s)


def downgrade() -> None:
    """Revert the change."""
    for name in ("run_s", *(name for name, _ in COLUMNS)):
        op.drop_column("jobs", name)
