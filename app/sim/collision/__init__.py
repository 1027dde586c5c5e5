"""Collision checks.

checker        What planners ask about collisions: people as shapes at one moment, free poses
               and motions
contact        Contact and clearance of one state, for live cell, decisions, safety layer and
               planners
fcl_recheck    Second opinion on whole trajectories: does FCL on the raw meshes find a contact?
fcl_reference  The reference for contact: python-fcl on the UR10's real collision meshes
kernels/       Compiled collision checks
"""
