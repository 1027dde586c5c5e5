"""The report: tables and figures of the thesis beside the results of Tandem.

page      the page, as Markdown
document  the page as one HTML file, with its figures
parts     numbers of result files and presets
sorting   chapter 3 of the thesis
motion    chapter 4
both      chapter 5
recipes   trainings of all chapters
"""
