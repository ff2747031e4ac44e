"""Hyperelastic laws of tissue behind one contract; import its modules by name."""
