"""Prints the benchmarks: `python -m experiments.bench [spine] [bus] [live] [predictive] [sensors]`."""

from __future__ import annotations

import sys

from experiments.bench import bus, live, predictive, sensors, spine

BENCHES = {
    "spine": spine.main,
    "bus": bus.main,
    "live": live.main,
    "predictive": predictive.main,
    "sensors": sensors.main,
}


def main() -> int:
    """Run the benches named on the command line, or all."""
    names = sys.argv[1:] or list(BENCHES)
    unknown = [name for name in names if name not in BENCHES]
    if unknown:
        print(f"no bench is called '{unknown[0]}'; expected some of {', '.join(BENCHES)}", file=sys.stderr)
        return 2
    for name in names:
        BENCHES[name]()
    return 0


if __name__ == "__main__":
    sys.exit(main())
