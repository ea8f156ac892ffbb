#!/usr/bin/python3
"""Rewrites the golden files from demonstrations.xml: the library as weights, and the motion of each primitive.

Only for a change of format or law that is meant; the tests of both languages read what this writes.
"""

from pathlib import Path

import coglab_controllers as cc

HERE = Path(__file__).resolve().parent


def main() -> None:
    """Writes weights.xml and motions.csv."""
    learnt = cc.Library()
    learnt.load(str(HERE / "demonstrations.xml"))
    learnt.save(str(HERE / "weights.xml"))
    rows = ["primitive,step,x,y,z"]
    for name in learnt.ids():
        primitive = learnt[name]
        dmp = cc.Dmp(primitive, primitive.start, primitive.goal + [0.05, -0.1, 0.02], ratio=1.3)
        for step in range(1, 401):
            position = dmp.step(0.005, primitive.goal + [0.05, -0.1, 0.02])
            if step % 20 == 0:
                rows.append(f"{name},{step}," + ",".join(repr(float(value)) for value in position))
    (HERE / "motions.csv").write_text("\n".join(rows) + "\n")


if __name__ == "__main__":
    main()
