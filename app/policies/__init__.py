"""Policies: training, inference and evaluation. Imports ``app.sim``, not web, api or store.

algorithms/   TD3 and DQN on Stable-Baselines3
checkpoints/  Checkpoint files and what they state
configs/      Training configurations (presets)
evaluation/   Evaluation: one module per protocol; results carry rates with 95 % intervals
inference/    Decisions of trained policies
networks/     Neural networks
report/       The report: tables and figures of the thesis beside the results of Tandem
training/     Training runs
"""
