"""What a setting may be called elsewhere, and the setting that is meant."""

from collections.abc import Iterable
from difflib import get_close_matches

SYNONYMS = {
    "ppo.n_iterations": "iterations num_iterations n_updates num_updates total_timesteps epochs",
    "ppo.n_steps": "num_steps nsteps rollout_length rollout_steps horizon steps_per_epoch",
    "ppo.n_episodes": "num_episodes num_episodes_between_training",
    "ppo.n_envs": "num_envs nenvs num_workers num_actors",
    "ppo.n_epochs": "num_epochs update_epochs noptepochs num_sgd_iter k_epochs ppo_epochs",
    "ppo.minibatch_size": "batch_size mini_batch_size mb_size sgd_minibatch_size num_minibatches",
    "ppo.learning_rate": "lr step_size adam_lr policy_lr pi_lr",
    "ppo.learning_rate_decay": "lr_decay lr_schedule anneal_lr",
    "ppo.max_grad_norm": "max_gradient_norm grad_clip gradient_clip clip_grad clip_grad_norm "
    "clip_gradients gradient_clipping grad_norm_clip global_norm",
    "ppo.normalize_rewards": "norm_reward normalize_reward reward_normalization reward_scaling",
    "ppo.gamma": "discount discount_factor",
    "ppo.gae_lambda": "lam lambda lambda_ gae lmbda",
    "ppo.clip_range": "clip cliprange clip_coef clip_param clip_ratio clip_eps eps_clip",
    "ppo.ent_coef": "entropy entropy_coef entropy_coeff entropy_beta beta_entropy ent_weight",
    "ppo.vf_coef": "value_coef value_loss_coef vf_loss_coeff critic_coef vf_weight",
    "ppo.kl_coef": "kl kl_coeff",
    "net.hidden": "hidden_sizes hidden_layers hiddens layers net_arch fcnet_hiddens",
    "net.init": "ortho_init orthogonal_init initialization weight_init",
    "net.activation": "activation_fn act_fn fcnet_activation nonlinearity",
    "net.obs_normalize": "norm_obs normalize_obs obs_norm normalize normalize_observations",
    "net.obs_clip": "clip_obs norm_obs_clip",
    "transfer.kickstart_coef": "beta beta_0 distill_coef kickstarting_coef",
    "transfer.teacher_temperature": "temperature",
    "select.threshold": "zeta",
    "q_learning.memory": "buffer_size replay_size replay_buffer_size memory_size",
    "q_learning.gradient_steps": "gradient_step n_gradient_steps",
    "eval.episodes": "eval_episodes n_eval_episodes num_eval_episodes",
    "env.max_steps": "max_episode_steps time_limit_steps",
    "env.id": "env_id env_name gym_id",
}
"""By setting, what Stable-Baselines3, CleanRL, RLlib, Spinning Up and papers call the same."""

NEAR = 0.6
"""How alike a misspelled name is, from 0 to 1; see `difflib`."""


def same_settings(name: str, known: Iterable[str]) -> list[str]:
    """Return the settings that are called so elsewhere, or in another section.

    Args:
        name: with or without a section, such as `ppo.lr` or `lr`.
        known: the settings of a card, as `section.key`.
    """
    key, known = _key(name), list(known)
    meant = [setting for setting, words in SYNONYMS.items() if key in words.split()]
    meant += [setting for setting in known if _key(setting) == key]
    return [setting for setting in dict.fromkeys(meant) if setting in known]


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return the end of a message about an unknown setting; empty where none is near.

    A misspelled name is looked for in its own section first.
    """
    known, section = list(known), name.rpartition(".")[0]
    meant = same_settings(name, known)
    if not meant:
        own_last = sorted(known, key=lambda setting: setting.startswith(f"{section}."))
        keys = {_key(setting): setting for setting in own_last}
        meant = [keys[near] for near in get_close_matches(_key(name), keys, n=3, cutoff=NEAR)]
    return f"; did you mean {' or '.join(meant[:3])}?" if meant else ""


def _key(name: str) -> str:
    """Return a setting's name without its section, as cards spell it."""
    return name.lower().replace("-", "_").rpartition(".")[2]
