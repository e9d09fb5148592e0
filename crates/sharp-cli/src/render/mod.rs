//! Pictures of maps, abstractions, plans and drives.
