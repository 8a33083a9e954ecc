"""One module a noun; each exports a ``router``."""
