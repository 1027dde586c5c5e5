"""Evaluation of the sorting scenario.

benchmark_tasks   Protocol ``sorting-tests``: many episodes of each benchmark task of the
                  thesis (3.4.3)
cycle_time        Protocol ``sorting-cycle-time``: parts per hour beside a working person
episodes          Run sorting episodes to their ends and count moves, attempts and risks
full_tasks        Results of full sorting tasks, and the throughput that they imply
grid              Protocol ``sorting-grid``: every pair of object and goal numbers
optimal_baseline  Optimal baseline of sorting episodes: the exact planner's moves and expected
                  attempts
order_rules       Order rules: selection among near-optimal sorting moves (docs/method.md 3.1)
people            Protocol ``sorting-people``: full sorting tasks beside a working person
planner_fallback  Progress monitor (``app/sim/sorting/progress_monitor.py``) of many sorting
                  tasks at once
task_states       Symbolic states of many sorting tasks that are executed side by side
"""
