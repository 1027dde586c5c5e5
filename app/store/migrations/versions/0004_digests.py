"""Digests of cells, motions and resume states; two resume states per job."""

import sqlalchemy as sa
from alembic import op

from app.digests import digest

revision = "0004"
down_revision = "0003"

DIGESTS = (
    ("cells", "name", "digest", ("definition",)),
    ("motions", "name", "summary_digest", ("summary",)),
    ("motions", "name", "digest", ("summary", "detail", "tensors")),
    ("resume_states", "job_id", "digest", ("manifest", "tensors")),
)
"""Table, key, new column, and the columns whose digest it holds."""


def upgrade() -> None:
    """Apply the change; what is stored now counts as undamaged."""
    for table, key, name, content in DIGESTS:
        op.add_column(table, sa.Column(name, sa.String(length=64), nullable=True))
        _fill(table, key, name, content)
    _set_resume_key("job_id", "step")


def downgrade() -> None:
    """Take it back."""
    newest = "SELECT MAX(step) FROM resume_states AS other WHERE other.job_id = r.job_id"
    op.execute(f"DELETE FROM resume_states AS r WHERE step < ({newest})")
    _set_resume_key("job_id")
    for table, _, name, _ in DIGESTS:
        op.drop_column(table, name)


def _fill(name: str, key: str, column: str, content: tuple[str, ...]) -> None:
    kinds = {one: sa.LargeBinary() if one == "tensors" else sa.JSON() for one in content}
    columns = [sa.column(one, kind) for one, kind in kinds.items()]
    table = sa.table(name, sa.column(key), sa.column(column), *columns)
    connection = op.get_bind()
    for found in connection.execute(sa.select(table.c[key])).all():
        this = table.c[key] == found[0]
        query = sa.select(*(table.c[one] for one in content))
        row = dict(connection.execute(query.where(this)).mappings().one())
        tensors = row.pop("tensors", b"")
        sealed = {column: digest(row, tensors)}
        connection.execute(sa.update(table).where(this).values(sealed))


def _set_resume_key(*columns: str) -> None:
    with op.batch_alter_table("resume_states") as batch:
        batch.drop_constraint("pk_resume_states", type_="primary")
        batch.create_primary_key("pk_resume_states", list(columns))
