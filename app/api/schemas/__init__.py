"""Bodies of requests and answers: one pydantic model per direction, units in descriptions.

cells           Work cells as they are shown and posted
checkpoints     Checkpoints as they are shown
examples        Example requests of the OpenAPI document; a test posts each of them
jobs            Jobs as they are shown
motion          ``POST /v1/motion``: state, people and goal in, the next trajectory segment out
numbers         Base classes and number types of the schemas
people          People in a request, and their use by a policy
plan            ``POST /v1/plan``: sorting task, robot and people in; next move and motion out
presets         Presets with the declarations of their fields, as the training form needs them
protocols       Protocols of evaluations, as the form of an evaluation needs them
recordings      Recordings of human motion as they are shown
results         Results of jobs as they are shown: evaluations, comparison of fields and curves
risk_map        ``POST /v1/risk-map``: a decision and the positions of a person in, choices and
                risks out
robot_state     Joints of the robot in a request: base to wrist 3, or in any order by name
separation      Speed and separation monitoring in a motion request and in its answer
sorting         ``POST /v1/sorting``: objects and goal in, next move out
sweeps          Trials of a sweep as they are shown
task_selection  ``POST /v1/task-selection``: state in, decision out
trackers        Trackers of key-points: frames in, estimates of people out
worlds          Live worlds as answers of the API: the snapshot itself, with the request of its
                decision
"""
