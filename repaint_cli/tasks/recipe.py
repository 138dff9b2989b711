"""A recipe says how a task is learned: networks, numbers of training, transfer and evaluation."""

from pydantic import Field

from repaint_cli.policies.architecture import NetConfig
from repaint_cli.settings import EvalConfig, PPOConfig, Settings
from repaint_cli.tasks.transfer_settings import QLearningConfig, SelectConfig, TransferConfig


class Recipe(Settings):
    """With which numbers a task is learned."""

    net: NetConfig = Field(default_factory=NetConfig)
    """The networks."""
    ppo: PPOConfig = Field(default_factory=PPOConfig)
    """Training."""
    transfer: TransferConfig = Field(default_factory=TransferConfig)
    """The teacher's part."""
    select: SelectConfig = Field(default_factory=SelectConfig)
    """Experience selection."""
    q_learning: QLearningConfig = Field(default_factory=QLearningConfig)
    """Q-learning in place of PPO."""
    eval: EvalConfig = Field(default_factory=EvalConfig)
    """Evaluation."""

    @property
    def automatic(self) -> bool:
        """Whether something of the transfer is decided by what is measured."""
        return "auto" in (
            self.transfer.kickstart_schedule, self.transfer.phases, self.transfer.start,
            self.select.rule,
        )  # fmt: skip
