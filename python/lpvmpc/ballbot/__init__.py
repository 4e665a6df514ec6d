"""The ballbot: a robot that stands on a ball, with everything that the program ``ballbot`` can do with it.

A scenario says which robot, controller, reference and world there are; it is run, varied in campaigns, and proved.
Logs of a robot tell its parameters. The numbers are the program's, bit for bit.

>>> from lpvmpc import ballbot
>>> scenario = ballbot.Scenario.builtin("two-setpoints")
>>> scenario.controller.horizon = 30
>>> run = scenario.simulate()
>>> run.state.shape, round(run.metrics["largest_tilt_rad"], 3)
((81, 4), 0.497)
"""

from .campaigns import CampaignResult, campaign, campaign_example
from .certificates import ProvedSet, certify, verify
from .identification import (
    Excitation,
    Fit,
    IdentifiedRobot,
    excite,
    identification_example,
    identify,
)
from .run import Motors, PlaneRun, Run, SensorLog
from .scenario import Scenario, Table, builtin_names
from .studies import Bench, GuaranteeCount, bench, count_guarantee, reproduce

__all__ = [
    "Bench",
    "CampaignResult",
    "Excitation",
    "Fit",
    "GuaranteeCount",
    "IdentifiedRobot",
    "Motors",
    "PlaneRun",
    "ProvedSet",
    "Run",
    "Scenario",
    "SensorLog",
    "Table",
    "bench",
    "builtin_names",
    "campaign",
    "campaign_example",
    "certify",
    "count_guarantee",
    "excite",
    "identification_example",
    "identify",
    "reproduce",
    "verify",
]
