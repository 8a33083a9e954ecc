"""The HTTP edge: validates once, calls one service, answers once."""
