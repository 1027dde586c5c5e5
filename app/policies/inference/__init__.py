"""Decisions of trained policies.

controllers           Controllers of the robot made of one trained policy, by inference mode
live_reach_policy     A reach policy in the live cell, with all its inference modes
motion_decision       Next trajectory segment toward a goal beside people
moved_person          People of a cell with one of them in other postures
onnx_export           Export of a pick or reach policy as an ONNX model (extra ``onnx``)
pick_training_range   Training range of a pick policy, to flag inputs outside it
reach_policy          A trained policy of the reach scenario, for inference
reach_training_range  Training range of a reach policy, to flag inputs outside it
recalibration         Recalibration of outcome probabilities by outcomes observed in one cell
rollout               Rollout policy improvement of a trained reach policy
sorting_plan          Next move of a sorting task together with its motion (docs/method.md 3.1)
sorting_policy        A trained sorting network, for inference
target_interpolation  Interpolation of actions for goals between training targets
task_selection        Task selection by the critic (docs/method.md 3.1)
trained_policy        Identity of a policy that was loaded from a checkpoint
value_networks        Actor, critics and outcome probabilities of a pick policy
"""
