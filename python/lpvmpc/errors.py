"""What can be wrong."""


class LpvmpcError(Exception):
    """The base of all errors of this package."""


class PlantError(LpvmpcError, ValueError):
    """A plant makes no sense: the message names the place and says what would be right."""


class SettingError(LpvmpcError, ValueError):
    """A setting, a state or a reference makes no sense: the message names it and says what would be right."""


class SimulationError(LpvmpcError, RuntimeError):
    """The plant's motion cannot be integrated."""


class MissingPackageError(LpvmpcError, ImportError):
    """A function needs a package that is not installed: the message says how to install it."""
