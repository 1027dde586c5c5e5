"""Collision checks.

checker        Collision queries of planners: people as shapes at one time, poses and motions
contact        Contact and clearance of one state, for live cell, decisions, safety layer and
               planners
fcl_recheck    Second opinion on whole trajectories: does FCL on the raw meshes find a contact?
fcl_reference  The reference for contact: python-fcl on the UR10's real collision meshes
kernels/       Compiled collision checks
"""
