"""The classes and functions that a VecNormalize's pickle may name; none is imported or called."""

_NUMPY = ("numpy.core", "numpy._core")
_SPACES = (
    "box.Box", "dict.Dict", "discrete.Discrete", "multi_binary.MultiBinary",
    "multi_discrete.MultiDiscrete",
)  # fmt: skip
_GENERATORS = (
    *(f"numpy.random._pickle.__{kind}_ctor" for kind in ("generator", "bit_generator")),
    "numpy.random._pickle.__randomstate_ctor", "numpy.random.__RandomState_ctor",
    "gym.utils.seeding.RandomNumberGenerator._generator_ctor",
    "numpy.random._mt19937.MT19937", "numpy.random._pcg64.PCG64", "numpy.random._pcg64.PCG64DXSM",
    "numpy.random._philox.Philox", "numpy.random._sfc64.SFC64",
    "numpy.random.bit_generator.SeedSequence",
    "numpy.random.bit_generator.__pyx_unpickle_SeedSequence",
)  # fmt: skip
"""Of random numbers, which a space that was seeded holds: gym's old ones are a RandomState."""

KNOWN = frozenset(
    [
        "collections.OrderedDict",
        "numpy.dtype",
        "numpy.ndarray",
        *(f"{core}.multiarray.{name}" for core in _NUMPY for name in ("_reconstruct", "scalar")),
        *(f"{core}.numeric._frombuffer" for core in _NUMPY),
        *_GENERATORS,
        "stable_baselines3.common.running_mean_std.RunningMeanStd",
        "stable_baselines3.common.vec_env.vec_normalize.VecNormalize",
        *(f"{library}.spaces.{name}" for library in ("gym", "gymnasium") for name in _SPACES),
    ]
)
"""All that a file may name."""
