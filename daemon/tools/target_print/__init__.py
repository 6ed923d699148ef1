"""Targets on paper, true to size: artwork in millimetres, laid out on a page, written as PDF or SVG.

A page is filled rectangles, discs and a few words, so the two vector formats are written here directly; a PDF
library would bring fonts and pictures that no target needs.
"""
