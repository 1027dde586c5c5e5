"""Tandem: a robot arm and a person share a work cell; learned policies choose and move."""
