"""The shapes that clients send and receive; together they make `openapi/openapi.json`."""
