"""Ids of Gymnasium's environments: a name, or `module:Name-v0` where the module registers it."""

from importlib import import_module
from typing import TYPE_CHECKING

from repaint_cli.errors import CardError

if TYPE_CHECKING:
    from gymnasium.envs.registration import EnvSpec


def name_of(env_id: str) -> str:
    """Return the name that an id is registered under."""
    return env_id.rpartition(":")[2]


def spec_of(env_id: str) -> "EnvSpec":
    """Return what is registered under an id; its module is imported first.

    Raises:
        CardError: there is no such module or environment, or the module cannot be imported.
    """
    import gymnasium

    module = env_id.rpartition(":")[0]
    try:
        if module:
            import_module(module)
        return gymnasium.spec(name_of(env_id))
    except Exception as error:  # a user's module raises any error
        reason = (str(error).strip() or type(error).__name__).splitlines()[0]
        raise CardError(f"gymnasium has no environment '{env_id}': {reason}") from error
