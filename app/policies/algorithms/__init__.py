"""TD3 and DQN on Stable-Baselines3."""
