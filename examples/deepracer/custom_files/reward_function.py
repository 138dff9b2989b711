def reward_function(params):
    """Pays for speed near the middle of the road."""
    if params["is_offtrack"]:
        return 1e-3
    aside = params["distance_from_center"] / (params["track_width"] / 2)
    return params["speed"] * max(1e-3, 1 - aside**2)
