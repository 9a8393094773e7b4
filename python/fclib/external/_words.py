"""Texts that several adapters use."""

RELAXATION = "does not solve Coulomb's law, but where nothing slides"
