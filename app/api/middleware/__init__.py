"""Pure ASGI layers; a function-style middleware would double the cost of a fix."""
