"""What observations are like, for people: whether a policy can see what changes in them."""

from math import floor, log10

from repaint_cli.policies.normalizer import Normalizer


def narrow_features(normalizer: Normalizer | None) -> str | None:
    """Return a line about features whose deviation lies far below `net.obs_min_std`, or None."""
    narrow = normalizer.narrow_features() if normalizer else {}
    if not narrow or normalizer is None:
        return None
    first, least = min(narrow.items(), key=lambda pair: pair[1])
    others = f" and {len(narrow) - 1} more" if len(narrow) > 1 else ""
    wanted = 10.0 ** floor(log10(least))
    return (
        f"feature {first} of the observations{others} deviates by only {least:.1g}, far below "
        f"net.obs_min_std, which is {normalizer.min_std:g}: policies hardly see it and learn the "
        f"slower; try --set net.obs_min_std={wanted:g}"
    )
