//! Option endpoints: centroid and interface options.
