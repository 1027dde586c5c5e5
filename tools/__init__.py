"""Offline generators, run by hand; compiled kernels are kept in ``data``, as those of tests.

arguments               Arguments of the generators and scripts
augmentation            Variation of the elbow along the same palm path, an augmentation of
                        demonstrations
check_vocabulary        Find words that the glossary replaces, and class names that occur twice
demonstrations          Synthetic demonstrations: reaches of a person between two places of
                        a cell
distance_fields         Smooth surfaces from round cones, for the model of the person
fit_capsules            Fit capsules that contain the UR10's collision meshes; run ``python -m
                        tools.fit_capsules``
fit_outcomes            Fit the outcome probabilities of a shipped pick policy again
generate_client         Writes ``app/client/operations/`` from the OpenAPI document
import_contracts        Import-linter contract: compiled kernels import only kernels, ``core``
                        and ``geometry``
install                 Install packages as ``pip install`` does, in a third of its time
make_primitives         Generate the shipped task primitives: ``python -m
                        tools.make_primitives``
model_mannequin         Model the drawn person: a worker of round cones, in a helmet and a vest
search_worst_people     Search the hand motions beside which the pick policy succeeds least
train_motion_predictor  Train the shipped motion predictor of pedestrians
train_worker_predictor  Train the shipped motion predictor of workers
docs/                   Scripts that measure, draw and write the result pages of ``docs``
"""

import os
from pathlib import Path

from app.sim.core.kernel_cache import kernel_cache

os.environ.setdefault("NUMBA_CACHE_DIR", str(kernel_cache(Path(__file__).parents[1] / "data")))
