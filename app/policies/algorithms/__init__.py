"""TD3 and DQN on Stable-Baselines3.

dqn                 DQN on Stable-Baselines3, extended at its extension points
exploration         Exploration in parallel environments: noise with a scale per environment,
                    and options
parameter_noise     Parameter-space noise: each episode is acted by a perturbed copy of the
                    actor
prioritized_replay  Replay buffer with priorities and n-step returns
td3                 TD3 on Stable-Baselines3, extended at its extension points
vecenv              A batch as Stable-Baselines3's ``VecEnv``, for every scenario
"""
