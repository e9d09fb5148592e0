//! Region-based Voronoi diagram.
