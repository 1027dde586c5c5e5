"""Collision checks.

checker        Collision queries of planners: people as shapes at one time, poses and motions
contact        Contact and clearance of one state, for live cell, decisions, safety layer and
               planners
fcl_recheck    Verification of whole trajectories by FCL on the raw meshes
fcl_reference  Reference collision checker: python-fcl on the UR10's collision meshes
kernels/       Compiled collision checks
"""
