"""Model predictive control of nonlinear plants, fast.

A plant comes from CasADi, do-mpc, acados, SymPy or matrices; a controller is made of it in one
line, and steps in microseconds:

>>> import lpvmpc
>>> integrator = lpvmpc.Plant.from_matrices([[0, 1], [0, 0]], [[0], [1]])
>>> mpc = lpvmpc.Mpc(integrator, t_s=0.1, horizon=20, q=[1, 0.1], r=[0.01], u_bounds=([-1], [1]))
>>> mpc.step([1, 0]).u0.tolist()
[-1.0]
"""

from . import ballbot
from .certificate import Certificate
from .constraints import Penalty, Row
from .design import Lqr, Verified, certify, lqr, verify
from .errors import (
    CertificateError,
    FalseClaimError,
    IdentificationError,
    LpvmpcError,
    MissingPackageError,
    PlantError,
    ScenarioError,
    SettingError,
    SimulationError,
)
from .estimator import Disturbance, Estimate, Estimator, Gate
from .mpc import Mpc
from .plan import ActiveBound, Plan
from .plant import Embedding, Plant, Signal, SteadyState
from .simulation import Run, simulate
from .world import Actuator, Jump, Load, Sensor

__all__ = [
    "ActiveBound",
    "Actuator",
    "Certificate",
    "CertificateError",
    "Disturbance",
    "Embedding",
    "Estimate",
    "Estimator",
    "FalseClaimError",
    "Gate",
    "IdentificationError",
    "Jump",
    "Load",
    "Lqr",
    "LpvmpcError",
    "MissingPackageError",
    "Mpc",
    "Penalty",
    "Plan",
    "Plant",
    "PlantError",
    "Row",
    "Run",
    "ScenarioError",
    "Sensor",
    "SettingError",
    "Signal",
    "SimulationError",
    "SteadyState",
    "Verified",
    "ballbot",
    "certify",
    "lqr",
    "simulate",
    "verify",
]

__version__ = "0.1.0"
