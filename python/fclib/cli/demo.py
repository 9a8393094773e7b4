"""``fclib demo``: placeholder until written below."""


def command() -> None:
    """Run the main job."""
