//! Stochastic simulator of wheeled robots.
