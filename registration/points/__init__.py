"""Points in arrays: layout, rigid motion, hash index, voxels, surfaces, sphere fit."""
