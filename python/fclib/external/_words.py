"""Texts that several adapters use."""

RELAXATION = "does not solve Coulomb's law, except if nothing slides"
