"""Names in the store's folder."""

DATABASE_NAME = "handeyed.sqlite"
