"""What made the published states, and the lists of chosen problems (`python -m workshop.sets`)."""
