"""What several adapters say."""

RELAXATION = "not Coulomb's law but its convex relaxation, exact where nothing slides"
