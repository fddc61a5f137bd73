//! Surfaces in normalised space: points, normals, areas, bounds, splitting and ray intersection in (u, v).
