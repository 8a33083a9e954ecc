"""
The store: rows and blobs to domain values and back.

Every function takes a `sqlalchemy.Connection` whose transaction the caller opened with
`app.store.engine.read` or `write`; nothing here commits.
"""
