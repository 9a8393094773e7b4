"""What families share. A module here is no family: the scan of `fclib.scenes` looks beside it.

family.py     what a family is, and what it makes: `Scene`, `Assembled`, `parameter`
mjcf.py       pieces of MJCF text: options, light, floor, bodies, colours
masonry.py    stones of masonry, arcades, supports that move; writes MJCF by mjcf.py
solids.py     elastic blocks, with loads and what holds them, for the finite elements of `simulate`
assembly.py   rigid bodies and contacts from geometry alone, assembled into a problem

family.py imports solids.py, masonry.py imports mjcf.py, and nothing here imports a family.
"""
