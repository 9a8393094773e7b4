"""Common parts of families. A module here is not a family: `fclib.scenes` does not scan here.

family.py     the base of families, and their products: `Scene`, `Assembled`, `parameter`
mjcf.py       pieces of MJCF text: options, light, floor, bodies, colours
masonry.py    stones of masonry, arcades, supports that move; writes MJCF by mjcf.py
solids.py     elastic blocks, with loads and supports, for the finite elements of `simulate`
assembly.py   rigid bodies and contacts from geometry alone, assembled into a problem

family.py imports solids.py, masonry.py imports mjcf.py, and nothing here imports a family.
"""
