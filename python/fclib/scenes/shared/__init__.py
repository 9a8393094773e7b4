"""Common parts of families. A module here is not a family: `fclib.scenes` does not scan here.

family.py     the base of families, and their products: `Scene`, `Assembled`, `parameter`
mjcf.py       pieces of MJCF text: options, light, floor, bodies, colours
masonry.py    stones of masonry, arcades, supports that move; writes MJCF by mjcf.py
deck.py       reads decks of LMGC90, with deck_bodies.py, deck_lines.py; deck_data.py: what they say
deck_scene.py the scene of a deck; deck_made.py: of a deck that is made by a rule
interaction.py  which shapes meet by which law, and what is driven
polyhedron.py volume, centre and inertia of polyhedra
recorded.py   steps of other engines as arrays in a file
solids.py     elastic blocks and meshes, with loads and supports, for finite elements
hex_box.py    meshes of boxes, of equal hexahedra
assembly.py   rigid bodies and contacts from geometry alone, assembled into a problem

family.py imports interaction.py and solids.py, hex_box.py imports solids.py, masonry.py and
deck_scene.py import mjcf.py, and nothing here imports a family.
"""
