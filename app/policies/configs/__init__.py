"""Training configurations (presets).

fields   Base of the training configurations: groups of fields with bounds, units and help
         texts
pick     Training configuration of the pick scenario: TD3 (docs/method.md 3.3, 3.5)
presets  Presets: every number of an experiment, frozen and named
reach    Training configurations of the reach scenario: TD3 and DDPG (docs/method.md 2.2, 2.3,
         2.5)
sorting  Training configurations of the sorting task: DQN (docs/method.md 1.4)
td3      Groups of fields that the trainings of both TD3 scenarios, pick and reach, share
"""
