"""Pure mathematics on point clouds: blocks of points in, blocks of points out."""
