"""Scripts that measure, draw and write the result pages of ``docs``.

augmentation_study  Measure the effect of motion augmentation: training with and without it
frame_plot          Draw the coordinate frame: robot base, axes, table, floor and person
headline            The table of headline results in the README
learning_curves     Collect learning curves of trainings and of other learners into a result
                    file
outcome_bounds      Measure how well the features of a pick predict its outcome beside one
                    kind of people
people_plots        Measure and draw the task primitives; write their section of
                    ``docs/people.md``
pick_plots          Draw the case studies and the calibration of the pick policy
pick_seeds          The table of picks by training seeds
pick_tables         Tables of the pick protocols with forms of their own
planner_optimality  Measure the exact sorting planner: optimality gap of its expected attempts,
                    and its time
recipe_plots        Draw the trainings of each recipe of the thesis beside ours
recording_plots     Measure the import of recorded motion and draw the error along one clip
results             Result files of ``docs/results``
screenshots         Take the pictures of the page that the documents show, from a server that
                    runs
site_hooks          Hooks of the documentation site
tables              Write the result tables of README, docs and model cards from
                    ``docs/results/*.json``
task_maximisation   Compare targets chosen by the critic in training with uniform targets
                    (thesis 5.2)
thesis_curves       Write the curves of trainings as they were recorded to a result file of the
                    report
training_curves     Train a preset and store learning curve and policies
reach/              Tables, pictures and studies of the reach scenario
sorting/            Tables, pictures and studies of the sorting scenario
world/              Validation of the simulator: measures, pictures and page
"""
