"""The pick scenario.

batch         The pick scenario of thesis chapter 5: one robot, one person, cubes and docks
candidate_observer
              Observations of one state for each of several candidates
case_geometry
              Geometry of a case study: nearer goal, and times at which the person blocks a goal
case_variants
              Variants of the four case studies, enumerated without a policy
case_verdict  Verdict on a run of a case study: expected, observed, as expected or not
cases         The four case studies of task selection (docs/method.md 3.6, thesis table 5.3)
curriculum_batch
              Pick environments whose robots start part of the path to the target
              (docs/method.md 3.5)
hand_speeds   Statistics of the speed of the workers' hands, reported with the results of
              evaluations
monitored_batch
              The pick scenario under speed and separation monitoring
person_grid   Postures of a person at the positions of a grid, for maps of choice and risk
raw_state     The raw state of (5.8) from the features that contain it
resting_people
              Planned motion beside people at rest, in place of a pick policy's
task_policy   Interface of a policy that selects a task, and its decision
valued_targets
              Pick environments whose targets are chosen by their values
kernels/      Compiled pick episodes
"""
