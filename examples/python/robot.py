"""From a robot in MJCF to a benchmark: robot.py [SCENE.xml].

Simulates the scene (without one, a dog of nine bodies that lands on its feet), stores the problems
of some steps, and compares solvers on them. `fclib simulate` and `fclib bench` do the same from the
command line.
"""

import sys
from pathlib import Path

import fclib
from fclib import bench, scenes, simulate
from fclib.bench import profiles

LEG = """
<body pos="{x} {y} 0">
  <joint type="hinge" axis="0 1 0" damping="0.5" stiffness="20" springref="30"/>
  <geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.03" mass="0.5"/>
  <body pos="0 0 -0.2">
    <joint type="hinge" axis="0 1 0" damping="0.5" stiffness="20" springref="-60"/>
    <geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.025" mass="0.3"/>
  </body>
</body>
"""
DOG = """
<mujoco model="dog">
  <option timestep="0.002" cone="elliptic"/>
  <default><geom friction="0.7"/></default>
  <worldbody>
    <geom type="plane" size="0 0 1"/>
    <body pos="0 0 0.5">
      <freejoint/>
      <geom type="box" size="0.25 0.12 0.05" mass="6"/>
      {legs}
    </body>
  </worldbody>
</mujoco>
"""


def example() -> Path:
    """The dog, in a file."""
    corners = [(x, y) for x in (-0.2, 0.2) for y in (-0.14, 0.14)]
    path = Path("dog.xml")
    path.write_text(DOG.format(legs="".join(LEG.format(x=x, y=y) for x, y in corners)))
    return path


def main(path: Path) -> None:
    """Simulate, store, compare."""
    folder = Path("robot")
    folder.mkdir(exist_ok=True)
    scene = scenes.Scene.from_file(path)
    files = []
    for step in simulate.simulate(scene, steps=200):
        if step.problem.nc > 0 and step.index % 20 == 0:
            files.append(folder / f"{scene.name}-{step.index:04d}.hdf5")
            fclib.write(files[-1], step.problem, step.result.solution)
    last = fclib.read(files[-1])
    print(f"{len(files)} problems; the last one: {last}")

    campaign = bench.Campaign.of(
        {
            "name": "robot",
            "solvers": ["auto", "nsgs", "nsn-ac", "admm"],
            "tolerances": [1e-6],
            "time_limit": 2.0,
            "problems": [{"files": [str(folder.resolve())], "family": scene.name}],
        }
    )
    bench.run_campaign(campaign, "robot.sqlite", jobs=1)
    for row in profiles.summary(profiles.costs(profiles.load("robot.sqlite"))):
        solved = f"{row['solved']} of {row['of']}, fastest on {row['fastest']}"
        print(f"{row['solver']:16} solved {solved}, mean {1e6 * row['mean']:.0f} us")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else example())
