"""What can be wrong."""


class LpvmpcError(Exception):
    """The base of all errors of this package."""


class PlantError(LpvmpcError, ValueError):
    """A plant makes no sense: the message names the place and says what would be right."""


class SettingError(LpvmpcError, ValueError):
    """A setting, a state or a reference makes no sense: the message names it and says what would be right."""


class CertificateError(LpvmpcError, ValueError):
    """There is no certificate, or one is refused: it is none, was changed, is of another plant, or claims what could not
    be shown, and may be true."""


class FalseClaimError(CertificateError):
    """A certificate claims what is false: the message names the claim and a state that shows it."""


class SimulationError(LpvmpcError, RuntimeError):
    """The plant's motion cannot be integrated."""


class ScenarioError(LpvmpcError, ValueError):
    """A scenario or a campaign makes no sense, or a study cannot be made of it: the message names the key and says what
    would be right."""


class IdentificationError(LpvmpcError, ValueError):
    """No robot was identified, or no excitation found: the message names the log and the place in it, or what was asked,
    and says what would be right."""


class MissingPackageError(LpvmpcError, ImportError):
    """A function needs a package that is not installed: the message says how to install it."""
