//! Reads and writes map files.
