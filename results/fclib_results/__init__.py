"""Published runs of FCLIB: what solvers did on the problems of the collection."""

__version__ = "1"
