"""What several adapters say."""

RELAXATION = "does not solve Coulomb's law, but where nothing slides"
