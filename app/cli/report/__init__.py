"""The command ``report``.

command   the command
page      the page that it writes
parts     numbers of result files and presets
sorting   chapter 3 of the thesis
motion    chapter 4
both      chapter 5
recipes   trainings of all chapters
"""
