"""What a problem is: ranks, conditioning, existence with its proof, and certified solutions.

>>> from fclib import analysis
>>> found = analysis.analyze(fclib.read("stack.hdf5"))
>>> found.existence.verdict, found.spectra["W"].rank, found.hyperstaticity

Existence is decided by conic programs, for which Clarabel is needed: ``pip install
"fclib[analysis]"``.
"""

from fclib.analysis._analyze import Analysis, Definiteness, Uniqueness, Units, analyze
from fclib.analysis._contacts import Energy, contacts, energy
from fclib.analysis._existence import (
    EXISTS_AT_HAND,
    EXISTS_SLATER,
    PROVEN_NOT,
    UNDECIDED,
    VERDICTS,
    Certificate,
    Existence,
    Slater,
    farkas,
)
from fclib.analysis._reference import Confirmation, Reference, reference
from fclib.analysis._spectrum import Spectrum

__all__ = [
    "EXISTS_AT_HAND",
    "EXISTS_SLATER",
    "PROVEN_NOT",
    "UNDECIDED",
    "VERDICTS",
    "Analysis",
    "Certificate",
    "Confirmation",
    "Definiteness",
    "Energy",
    "Existence",
    "Reference",
    "Slater",
    "Spectrum",
    "Uniqueness",
    "Units",
    "analyze",
    "contacts",
    "energy",
    "farkas",
    "reference",
]
