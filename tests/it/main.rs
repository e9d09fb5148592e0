//! One binary of integration tests.
mod maps;
