"""The simulated city with its truth, and what is measured on it."""
