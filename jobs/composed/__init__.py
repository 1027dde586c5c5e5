"""Jobs made of jobs: the supervisor advances them, their parts run like any other job.

composer   Base class: advances the open jobs of one kind, at most once in a period
reports    Reports: their evaluations as jobs, and their pages
sweeps     Sweeps: trainings with drawn fields, and their evaluations, as jobs
"""
