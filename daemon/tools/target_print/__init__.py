"""Printed targets, true to size: artwork in millimetres, laid out on a page, written as PDF or SVG.

A page consists of filled rectangles, discs and a few lines of text, so both formats are written directly, without a
PDF library.
"""
