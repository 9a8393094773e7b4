"""Pieces of MJCF text that the families share: physics options, light, sky, floor, cubes.

The format is MuJoCo's: https://mujoco.readthedocs.io/en/stable/XMLreference.html
Numbers are written with `repr`, so that text and float are the same to the last bit.
"""

from __future__ import annotations

import colorsys
from collections.abc import Iterable

# the looks do not act on the mechanics; angles in radians everywhere
_DOCUMENT = """\
<mujoco model="{name}">
  <compiler angle="radian" alignfree="true"/>
  <option timestep="{time_step!r}" gravity="0 0 {gravity!r}" cone="elliptic" jacobian="sparse"/>
  <size memory="256M"/>
  <visual>
    <headlight ambient="0.46 0.46 0.48" diffuse="0.2 0.2 0.2" specular="0.05 0.05 0.05"/>
    <quality shadowsize="4096" offsamples="8"/>
    <map fogstart="4" fogend="12" haze="0.3"/>
    <rgba haze="0.93 0.95 0.97 1" fog="0.93 0.95 0.97 1"/>
  </visual>
  <asset>
    <texture name="sky" type="skybox" builtin="gradient" rgb1="0.93 0.95 0.97"
             rgb2="0.55 0.68 0.82" width="512" height="512"/>
    <texture name="checker" type="2d" builtin="checker" rgb1="0.84 0.85 0.86"
             rgb2="0.77 0.79 0.81" width="512" height="512"/>
    <material name="floor" texture="checker" texuniform="true" texrepeat="{tiles!r} {tiles!r}"
              reflectance="0" specular="0.1" shininess="0.1"/>
    <material name="solid" specular="0.25" shininess="0.35"/>
{assets}
  </asset>
  <worldbody>
    <light type="directional" pos="0 0 0" dir="-0.72 0.22 -0.85"
           diffuse="0.56 0.55 0.52" specular="0.15 0.15 0.15" castshadow="true"/>
    <geom name="floor" type="plane" size="0 0 1" material="floor" condim="3"
          friction="{floor_mu!r}"/>
{bodies}
  </worldbody>
</mujoco>
"""


def document(
    name: str,
    *,
    bodies: Iterable[str],
    assets: Iterable[str] = (),
    time_step: float,
    gravity: float,
    floor_mu: float,
    tile: float,
) -> str:
    """An MJCF document: the bodies above a horizontal floor at z = 0.

    time_step in s, gravity (downwards) in m/s^2, floor_mu without unit; tile is the edge of the
    floor's squares in m. MuJoCo takes for a contact the larger friction of its two geometries.
    """
    return _DOCUMENT.format(
        name=name,
        time_step=time_step,
        gravity=-gravity,
        floor_mu=floor_mu,
        # two squares a texture
        tiles=0.5 / tile,
        assets=indent(assets),
        bodies=indent(bodies),
    )


def indent(elements: Iterable[str]) -> str:
    return "\n".join("    " + element for element in elements)


def numbers(*values: float) -> str:
    """An MJCF list of numbers, exact."""
    return " ".join(repr(float(value)) for value in values)


def cube_mesh(name: str, edge: float) -> str:
    """A cube as a mesh: its faces touch in the corners of their overlap, 4 for a cube on a plane.

    The box primitive gives up to 8 points for the same pair.
    """
    a = 0.5 * edge
    corners = [numbers(x, y, z) for x in (-a, a) for y in (-a, a) for z in (-a, a)]
    return f'<mesh name="{name}" vertex="{"  ".join(corners)}"/>'


def shade(index: int, count: int) -> str:
    """The colour of body `index` of `count`: from blue to sand, every second one lighter."""
    t = index / max(count - 1, 1)
    hue = 0.58 - 0.47 * t
    lightness = 0.52 + 0.08 * (index % 2)
    red, green, blue = colorsys.hls_to_rgb(hue, lightness, 0.45)
    return f"{red:.3f} {green:.3f} {blue:.3f} 1"
