"""Sets of choices with a name: `--preset`."""

PRESETS = {
    "coach": (
        "ppo.time_limit=terminal",
        "ppo.vf_coef=1.0",
        "ppo.clip_decay=488",  # 10⁶ steps of 2,048 an iteration
        "ppo.whole_episodes=true",
        "ppo.n_envs=1",  # whose episodes follow one another, so that the last one is cut
    ),
}
"""`coach`: what the framework of the paper's experiments does where our defaults differ (RL Coach's
clipped PPO for MuJoCo), to approach the paper's own baseline. Settings as in --set."""
