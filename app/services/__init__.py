"""
One function a use case: gather in a transaction, compute, apply in a transaction.

Functions take the engine of `app.store.engine.create_store_engine` and raise `app.errors` only.
"""
