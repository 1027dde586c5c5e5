"""Tables, pictures and studies of the reach scenario.

ablation     Ablation study of ``reach-td3``: one change at a time, several training seeds
curves       Collect learning curves of the reach scenario
other_plots  Draw the other reach results: several people, trackers, smoothness, learning curves
plots        Draw the pictures of ``docs/results/reach.md``
seeds        Evaluate several training seeds of one preset on all targets
ssm_plots    Draw policy and planners under speed and separation monitoring
style        Style that the pictures of the reach results share
tables       Tables of the reach evaluations: measures and column headers
"""
