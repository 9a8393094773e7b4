"""The collection: families of problems, built from scenes, with a catalogue.

    fclib.collection("rt444")[100]      a problem of the user's folder; built if missing
    fclib.load("tiny/RollingDiscs/0040")  one that comes with the package
    collections.record(...)             scenes ──> trajectories: simulates, and solves each step
    collections.build(...)              trajectories ──> problems, solutions, files ──> catalogue
    collections.verify(...)             compares files with the catalogue, judges solutions again
    collections.publish(...), get(...)  archives with their SHA-256 for any static web server

The name of a problem is SET/FAMILY/NUMBER, for example rt444/KaplasTower/0100. The number counts
the steps of the family's scene that have a contact, or the problems of a family that is assembled
directly.

plan.py       which problems of a family are built, and which are kept; their license and citation
trajectory.py stored states, from which problems are assembled, and their files. Needs handed.py
handed.py     problems of states that another engine handed over, with its contacts
published.py  the trajectories of all published versions. Needs trajectory.py
set_index.py  the sets, their versions and their families; lists of chosen problems in data/
record.py     a simulation into a trajectory. Needs trajectory.py, catalog.py
catalog.py    a row for each problem, in catalog.parquet. Needs no other module
references.py solutions: finds them, judges them by both maps, stores them; makes guesses of them.
              Needs catalog.py
build.py      makes the files of a family; goes on after a kill. Needs plan.py, references.py and
              ratings.py
verify.py     compares files with the catalogue, and judges solutions again
add.py        takes existing files in as a set. Needs build.py, set_index.py, references.py
figures.py    distributions and pictures
archives.py   publish and get. Needs catalog.py, set_index.py
sequence.py   consecutive problems, with guesses, and their file. Needs references.py, library.py
library.py    the package's and the user's folder, over all of these: `collection` and `load`
ratings.py    which problems are easy, hard or open, by stored runs. Needs set_index.py

How the lists of data/ were chosen is in workshop/sets of the repository.
"""

from fclib.collections.add import Refusal, Rules, add, plain
from fclib.collections.archives import get, publish
from fclib.collections.build import build
from fclib.collections.catalog import CatalogError, read_catalog
from fclib.collections.library import Collection, load
from fclib.collections.plan import Plan, Selection, Simulation, families
from fclib.collections.published import VersionError, file_name
from fclib.collections.record import record
from fclib.collections.references import guess_of
from fclib.collections.sequence import Step, sequence, write_sequence
from fclib.collections.set_index import (
    folders,
    fresh_plan,
    from_folder,
    numbered,
    origin_of,
    plan_of,
    sets,
    version,
)
from fclib.collections.trajectory import Trajectory, TrajectoryError
from fclib.collections.trajectory import read as read_trajectory
from fclib.collections.verify import verify

__all__ = [
    "CatalogError",
    "Collection",
    "Plan",
    "Refusal",
    "Rules",
    "Selection",
    "Simulation",
    "Step",
    "Trajectory",
    "TrajectoryError",
    "VersionError",
    "add",
    "build",
    "families",
    "file_name",
    "folders",
    "fresh_plan",
    "from_folder",
    "get",
    "guess_of",
    "load",
    "numbered",
    "origin_of",
    "plain",
    "plan_of",
    "publish",
    "read_catalog",
    "read_trajectory",
    "record",
    "sequence",
    "sets",
    "verify",
    "version",
    "write_sequence",
]
