"""Jobs that consist of other jobs; the supervisor advances them, their parts run as jobs.

composer   Base class: advances the open jobs of one kind, at most once in a period
parts      Queueing of the parts of a composed job
reports    Reports: their evaluations as jobs, and their pages
sweeps     Sweeps: trainings with drawn fields, and their evaluations, as jobs
"""
