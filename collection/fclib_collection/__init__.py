"""Trajectories of the collection of FCLIB: the states that its problems are assembled from."""

__version__ = "1"
