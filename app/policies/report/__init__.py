"""The report: tables and figures of the thesis beside the results of Tandem.

commands   Commands that measure result files
document   The page as one HTML file, with its figures
numbers    Numbers of result files, presets and settings as text
page       The page: ``thesis.md`` with its numbers and their provenance
thesis.md  Text, tables and figures, with a placeholder for each number
"""
