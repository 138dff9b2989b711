def reward_function(params):
    """Pays for the square of the speed, as long as two wheels are on the road."""
    return 1e-3 if params["is_offtrack"] else params["speed"] ** 2
