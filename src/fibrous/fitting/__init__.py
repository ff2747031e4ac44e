"""Constitutive constants from curves of networks, and the constants as a function of alignment."""
