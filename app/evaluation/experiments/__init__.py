"""What is measured: points, the settings they need, and the fixes made under each."""
