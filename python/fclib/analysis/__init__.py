"""Analysis of a problem: ranks, conditioning, existence with proof, and certified solutions.

>>> from fclib import analysis
>>> found = analysis.analyze(fclib.read("stack.hdf5"))
>>> found.existence.verdict, found.spectra["W"].rank, found.hyperstaticity

Conic programs decide existence; they need Clarabel: ``pip install
"fclib[analysis]"``.

_analyze.py     the result of `analyze`, in one record. Needs _spectrum.py and _self_stress.py
_brief.py       the cheap part of it, for every file that is built. Needs _analyze.py
_reactions.py   whether reactions are unique, by the contacts of a solution. Needs _enumerate.py
_existence.py   whether there is a solution. Needs _enumerate.py, _conic.py, _joints.py and
                _certificate.py
_self_stress.py whether reactions can grow while nothing moves. Needs _existence.py
_enumerate.py   all solutions of a small problem. Needs _rational.py and _spatial.py
_spatial.py     all solutions of one spatial contact, by the roots of polynomials
_rational.py    linear systems and linear programs in exact arithmetic
_certificate.py a proof that there is no solution, checked in exact arithmetic
_reference.py   certified solutions, by two unrelated algorithms. Needs _least_norm.py
_least_norm.py  the least of all reactions of a velocity. Needs _motion.py, _conic.py and
                _reactions.py
_motion.py      the reactions that move nothing, also with redundant joints. Needs _joints.py
_conventions.py whether the normal component seems not to be first
_contacts.py    statuses and energies, contact by contact
_spectrum.py    ranks, singular values, definiteness
_joints.py      whether joints agree. Needs _rational.py and _bounds.py
_bounds.py      sums and singular values, with guaranteed bounds
_conic.py       conic programs, solved by Clarabel
_data.py        a problem's matrices and its local form; all others use it
"""

from fclib.analysis._analyze import Analysis, Definiteness, Uniqueness, Units, analyze
from fclib.analysis._brief import Brief, brief
from fclib.analysis._certificate import (
    Certificate,
    CertificateError,
    check,
    check_arrays,
    farkas,
    read_certificate,
)
from fclib.analysis._contacts import Energy, contacts, energy
from fclib.analysis._conventions import conventions
from fclib.analysis._enumerate import Enumeration, SolutionSet, enumerate_solutions
from fclib.analysis._existence import (
    EXISTS_AT_HAND,
    EXISTS_ENUMERATED,
    EXISTS_SLATER,
    PROVEN_NOT,
    UNDECIDED,
    VERDICTS,
    Existence,
    Slater,
)
from fclib.analysis._reactions import Reactions
from fclib.analysis._reference import Confirmation, Reference, reference
from fclib.analysis._self_stress import OPEN, PRESTRESSED, SOLVABLE, SelfStress
from fclib.analysis._spectrum import Spectrum

__all__ = [
    "EXISTS_AT_HAND",
    "EXISTS_ENUMERATED",
    "EXISTS_SLATER",
    "OPEN",
    "PRESTRESSED",
    "PROVEN_NOT",
    "SOLVABLE",
    "UNDECIDED",
    "VERDICTS",
    "Analysis",
    "Brief",
    "Certificate",
    "CertificateError",
    "Confirmation",
    "Definiteness",
    "Energy",
    "Enumeration",
    "Existence",
    "Reactions",
    "Reference",
    "SelfStress",
    "Slater",
    "SolutionSet",
    "Spectrum",
    "Uniqueness",
    "Units",
    "analyze",
    "brief",
    "check",
    "check_arrays",
    "contacts",
    "conventions",
    "energy",
    "enumerate_solutions",
    "farkas",
    "read_certificate",
    "reference",
]
