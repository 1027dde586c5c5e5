"""Training and evaluation as jobs: specs, supervisor, executors and the one entry point.

access             Access of a worker to its job: read it, report, end it
attempt            One attempt of a job in its own process: arguments, logging, exit status
cell_catalog       Work cells by name: the shipped ones, and the user's own from the database
checkpoints        Checkpoints and the store: a damaged shipped one is restored where it is read
comparison         Comparison of jobs: the fields that differ, and learning curves with a band
                   over seeds
composed/          Jobs made of jobs: sweeps and reports
executor           Executor of attempts: one local process per attempt
import_process     Import of a file in its own process: ``python -m jobs.import_process``
inputs             Inputs of a job: its cell, checkpoint and recordings, and the files of its
                   replay memory
job_changes        What can be changed of a posted job: labels and budgets
recording_catalog  Stored recordings by name: files in, runs of the 18-DoF human model out
recording_format   The stored form of a recording
remote/            Workers that reach their job over HTTP, and the executor on Ray
resume_files       Files that trainings need to resume: the transitions of their replay
                   memories
retention          Removal of checkpoints, and of ended jobs with their files
run                Entry point of a job's process: ``python -m jobs.run --job ID --attempt N``
spec               Job specs: the body of ``POST /v1/jobs``, stored unchanged with the job
start              Start of a child process: the parent-death signal, before heavy imports
supervisor         The supervisor: a thread of the server that starts, monitors and stops
                   workers
timeouts           Timeouts of the supervisor
worker             The worker of a job: one attempt in one process
"""
