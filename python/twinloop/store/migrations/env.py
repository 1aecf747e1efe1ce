"""Where Alembic carries out a migration: on the connection that the store has opened, in its transaction."""

from alembic import context

context.configure(connection=context.config.attributes["connection"], transaction_per_migration=False)
context.run_migrations()
