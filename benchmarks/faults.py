"""What a robot has to bear in a campaign: faults from every layer, drawn from a seed.

A fault is a value: what, when, how long. So a schedule can be printed, and tried without a part.
"""

import math
from dataclasses import dataclass

import numpy as np

# By layer: each fault with the least and the greatest number of seconds that it lasts.
FAULTS: dict[str, dict[str, tuple[float, float]]] = {
    "link": {
        "laser silence": (0.5, 8.0),
        "laser unplug": (0.5, 8.0),
        "laser noise": (2.0, 15.0),
        "base silence": (0.5, 8.0),
        "base unplug": (0.5, 8.0),
        "base noise": (2.0, 15.0),
    },
    "device": {
        "laser reboot": (0.0, 0.0),
        "laser stalled": (0.5, 5.0),
        "laser unstable": (0.5, 5.0),
        "laser abnormal": (0.0, 0.0),
        "base reboot": (0.0, 0.0),
        "base low battery": (1.0, 10.0),
        "base over-current": (0.5, 3.0),
        "base short part": (0.2, 2.0),
        "base unknown part": (0.5, 5.0),
        "base no replies": (1.0, 10.0),
    },
    "sensing": {
        "laser frozen": (0.5, 5.0),
        "laser blind": (0.5, 5.0),
        "base bump": (0.1, 2.0),
        "base cliff": (0.1, 2.0),
    },
    "world": {
        "base slip": (0.0, 0.0),
        "base wheel drop": (0.5, 4.0),
        "carried": (2.0, 4.0),
        "person": (math.inf, math.inf),
    },
    "process": {
        "kill": (2.0, 5.0),
        "kill, journal cut": (2.0, 5.0),
        "kill, journal bit": (2.0, 5.0),
        "kill, snapshot cut": (2.0, 5.0),
        "restart": (0.5, 3.0),
    },
    "disk": {"disk full": (1.0, 20.0)},
    "network": {
        "nobody listens": (1.0, 20.0),
        "garbage": (1.0, 5.0),
        "driven carelessly": (4.0, 10.0),
    },
    "requests": {
        "pause": (3.0, 8.0),
        "goto": (6.0, 12.0),  # until it is asked to explore again
        "home": (6.0, 12.0),
        "relocalise": (6.0, 12.0),
        "stop": (2.0, 5.0),
        "save": (0.0, 0.0),
        "set": (0.0, 0.0),
    },
}
LAYER = {name: layer for layer, faults in FAULTS.items() for name in faults}
FIRST_S, LAST_S = 2.0, 35.0  # faults begin between


@dataclass(frozen=True, slots=True, order=True)
class Fault:
    """One of FAULTS: it begins at a time (s) and lasts for so long (s)."""

    at: float
    name: str
    lasts: float

    def __str__(self) -> str:
        lasting = f" for {self.lasts:.2f} s" if 0.0 < self.lasts < math.inf else ""
        return f"{self.at:6.2f} s: {self.name}{lasting} ({LAYER[self.name]})"


def draw(seed: int) -> list[Fault]:
    """The schedule of a seed: three to eight faults, each layer as likely as any other."""
    rng = np.random.default_rng((seed, 21))
    layers = list(FAULTS)
    faults = []
    for _ in range(int(rng.integers(3, 9))):
        kinds = FAULTS[layers[int(rng.integers(len(layers)))]]
        name = list(kinds)[int(rng.integers(len(kinds)))]
        least, most = kinds[name]
        at = 0.0 if most == math.inf else round(float(rng.uniform(FIRST_S, LAST_S)), 2)
        lasts = most if most == math.inf else round(float(rng.uniform(least, most)), 2)
        faults.append(Fault(at, name, lasts))
    return sorted(faults)
