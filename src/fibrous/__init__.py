"""Fibre networks of soft tissue, and the continuum laws that stand in for them."""
